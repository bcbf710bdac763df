"""The README and the pages of docs: every example runs, every picture is there, every link leads somewhere."""

from __future__ import annotations

import contextlib
import functools
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
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
LINKING = [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
RECIPES = sorted((ROOT / "docs" / "recipes").glob("*.yaml"))
PICTURES = ROOT / "docs" / "images"
SET_UP = [
    'python3 -m venv .venv && .venv/bin/pip install -q -c constraints.txt -e ".[dev]" && '
    ".venv/bin/torchsynth synthesize sample:brick --size 256x256 -o texture.png --overwrite",
    ".venv/bin/python -m pytest -q",
]
BUILD = "sphinx-build -W docs site"


@pytest.fixture(scope="module", autouse=True)
def _one_thread():
    """Small steps on a busy machine: a second thread would mostly wait. The results are the same."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def _blocks(text, *languages):
    """The fenced blocks of a text, in order, as (language, content)."""
    fenced = re.findall(r"^```([\w{}]*).*?\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    return [(language, content) for language, content in fenced if language in languages]


def _sections():
    """The parts of the pages that hold examples, by heading; each can be followed on its own."""
    found = []
    for page in PAGES:
        pieces = re.split(r"^##+ (.+)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
        pieces = ["", "before the first heading", *pieces]
        sections = zip(pieces[1::2], pieces[2::2], strict=True)
        found += [
            pytest.param(page.stem, text, id=f"{page.stem}: {title}")
            for title, text in sections
            if _blocks(text, "python", "sh")
        ]
    return found


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
    """One folder for the whole of a page, so that no example stumbles over the files of another."""

    @functools.cache
    def of(page):
        folder = tmp_path_factory.mktemp(page)
        shutil.copytree(ROOT / "docs" / "recipes", folder / "docs" / "recipes")
        shutil.copy(ROOT / "docs" / "jobs.yaml", folder / "docs" / "jobs.yaml")
        return folder

    return of


@pytest.mark.parametrize(("page", "section"), _sections())
def test_examples_run(page, section, checkout, monkeypatch):
    monkeypatch.chdir(checkout(page))
    for language, block in _blocks(section, "python", "sh"):
        if language == "python":
            exec(compile(block, page, "exec"), {"__name__": page})  # noqa: S102
            continue
        for line in _commands(block):
            code, said = _run(line)
            assert code == 0, line
            assert said, line


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_blocks_are_of_a_kind_that_is_tested(page):
    text = page.read_text(encoding="utf-8")
    known = _blocks(text, "python", "sh", "yaml", "{include}", "{toctree}")
    assert len(re.findall("^```", text, re.MULTILINE)) == 2 * len(known)


def _other_commands(page):
    """The lines of shell that are not run here."""
    lines = [
        line for _, block in _blocks(page.read_text(encoding="utf-8"), "sh") for line in block.splitlines()
    ]
    return [line for line in lines if not line.startswith("torchsynth ")]


def test_set_up_is_two_commands():
    assert _other_commands(PAGES[0]) == [*SET_UP, BUILD]


@pytest.mark.parametrize("page", PAGES[1:], ids=lambda page: page.stem)
def test_scripts_that_pages_name_are_there(page):
    """They have tests of their own."""
    for line in _other_commands(page):
        python, script, *_ = line.split()
        assert python == "python"
        assert (ROOT / script).is_file()


def test_recipes_shown_are_the_files():
    files = [path.read_text(encoding="utf-8") for path in (*RECIPES, ROOT / "docs" / "jobs.yaml")]
    shown = [block for page in PAGES for _, block in _blocks(page.read_text(encoding="utf-8"), "yaml")]
    assert shown
    assert all(block in files for block in shown)


@pytest.mark.parametrize("page", LINKING, ids=lambda page: page.stem)
def test_links_lead_somewhere(page):
    targets = re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text(encoding="utf-8"))
    assert [target for target in targets if not (page.parent / target).exists()] == []


def test_pictures_are_small_and_all_used():
    linked = {
        (page.parent / target).resolve()
        for page in PAGES
        for target in re.findall(r"!\[[^]]*\]\(([^)]+)\)", page.read_text(encoding="utf-8"))
    }
    assert linked == set(PICTURES.iterdir())
    sizes = [path.stat().st_size for path in linked]
    assert max(sizes) < 150_000
    assert sum(sizes) < 1_400_000
