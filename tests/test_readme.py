"""The README: every example runs, every picture is there, every link leads somewhere."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import shutil
from pathlib import Path

import pytest
import torch

from torchsynth import cli

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
RECIPES = sorted((ROOT / "docs" / "recipes").glob("*.yaml"))
PICTURES = ROOT / "docs" / "images"
SET_UP = [
    'python3 -m venv .venv && .venv/bin/pip install -q -c constraints.txt -e ".[dev]" && '
    ".venv/bin/torchsynth synthesize sample:brick --size 256x256 -o texture.png --overwrite",
    ".venv/bin/python -m pytest -q",
]


@pytest.fixture(scope="module", autouse=True)
def _one_thread():
    """Small steps on a busy machine: a second thread would mostly wait. The results are the same."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def _blocks(text, *languages):
    """The fenced blocks of a text, in order, as (language, content)."""
    fenced = re.findall(r"^```(\w*)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    return [(language, content) for language, content in fenced if language in languages]


def _sections():
    """The parts of the README that hold examples, by heading; each can be followed on its own."""
    pieces = re.split(r"^##+ (.+)$", README, flags=re.MULTILINE)
    sections = zip(pieces[1::2], pieces[2::2], strict=True)
    return [pytest.param(text, id=title) for title, text in sections if _blocks(text, "python", "sh")]


def _commands(block):
    return [line for line in block.splitlines() if line.startswith("torchsynth ")]


def _run(line):
    """One command line, in this process, with its output redirected if it asks for that."""
    command, _, target = line.partition(" > ")
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        code = cli.main(shlex.split(command)[1:])
    if target:
        Path(target).write_text(said.getvalue(), encoding="utf-8")
    return code, said.getvalue()


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """One folder for the whole README, so that no example stumbles over the files of another."""
    folder = tmp_path_factory.mktemp("readme")
    shutil.copytree(ROOT / "docs" / "recipes", folder / "docs" / "recipes")
    shutil.copy(ROOT / "docs" / "jobs.yaml", folder / "docs" / "jobs.yaml")
    return folder


@pytest.mark.parametrize("section", _sections())
def test_examples_run(section, checkout, monkeypatch):
    monkeypatch.chdir(checkout)
    for language, block in _blocks(section, "python", "sh"):
        if language == "python":
            exec(compile(block, "README.md", "exec"), {"__name__": "readme"})  # noqa: S102
            continue
        for line in _commands(block):
            code, said = _run(line)
            assert code == 0, line
            assert said, line


def test_blocks_are_of_a_kind_that_is_tested():
    assert README.count("\n```") == 2 * len(_blocks(README, "python", "sh", "yaml"))


def test_set_up_is_two_commands():
    lines = [line for _, block in _blocks(README, "sh") for line in block.splitlines()]
    assert [line for line in lines if not line.startswith("torchsynth ")] == SET_UP


def test_recipes_shown_are_the_files():
    files = [path.read_text(encoding="utf-8") for path in (*RECIPES, ROOT / "docs" / "jobs.yaml")]
    assert files
    assert all(block in files for _, block in _blocks(README, "yaml"))


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md"])
def test_links_lead_somewhere(page):
    targets = re.findall(r"\]\(([^)#]+)\)", (ROOT / page).read_text(encoding="utf-8"))
    assert [
        target for target in targets if not (target.startswith("https:") or (ROOT / target).exists())
    ] == []


def test_pictures_are_small_and_all_used():
    linked = {ROOT / target for target in re.findall(r"!\[[^]]*\]\(([^)]+)\)", README)}
    assert linked == set(PICTURES.iterdir())
    sizes = [path.stat().st_size for path in linked]
    assert max(sizes) < 150_000
    assert sum(sizes) < 1_400_000
