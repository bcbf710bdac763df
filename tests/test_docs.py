"""The documentation: it builds without a warning, and nothing public is missing from it."""

from __future__ import annotations

import html
import re
import subprocess
import sys
from pathlib import Path

import pytest
from sphinx.util.inventory import InventoryFile

import torchsynth as ts
from tests.test_readme import BUILD

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The documentation, built as the README says, into a folder of its own."""
    folder = tmp_path_factory.mktemp("site")
    assert BUILD.startswith("sphinx-build ")
    options = BUILD.replace(" site", f" {folder}").split()[1:]
    command = [sys.executable, "-m", "sphinx", "-q", *options]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
    return folder


@pytest.fixture(scope="module")
def names(site):
    """What the reference has an entry for."""
    objects = InventoryFile.loads((site / "objects.inv").read_bytes(), uri="").data
    return {name for kind, entries in objects.items() if kind.startswith("py:") for name in entries}


def _text(page):
    return html.unescape(re.sub("<[^>]+>", "", page.read_text(encoding="utf-8")))


def test_every_public_name_has_an_entry(names):
    wanted = {f"torchsynth.{name}" for name in ts.__all__}
    wanted |= {f"torchsynth.recipes.{name}" for name in ts.recipes.__all__}
    wanted |= {f"torchsynth.metrics.{name}" for name in ts.metrics.__all__}
    assert wanted - names == set()


def test_every_module_has_an_entry(names):
    modules = {
        path.relative_to(ROOT) for path in (ROOT / "torchsynth").rglob("*.py") if path.stem != "__main__"
    }
    dotted = {".".join(path.with_suffix("").parts).removesuffix(".__init__") for path in modules}
    # The page of the whole package is the reference itself, and the studio is a page, not a library.
    dotted = {name for name in dotted if not name.startswith("torchsynth.studio")}
    assert dotted - names - {"torchsynth"} == set()


def test_annotations_read_as_they_are_written(site):
    assert "Float64[Tensor, 'batch levels']" in _text(site / "api" / "results.html")
    parts = _text(site / "api" / "parts.html")
    assert "weight: int = 1" in parts
    assert "Annotated[" not in parts


def test_the_guide_has_the_pictures_of_the_readme(site):
    page = (site / "guide.html").read_text(encoding="utf-8")
    assert "_images/strip.jpg" in page
    assert (site / "_images" / "strip.jpg").is_file()


def test_nothing_is_fetched(site):
    """A page may link elsewhere, but what it shows is its own."""
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert 'src="http' not in text
        assert '<link rel="stylesheet" href="http' not in text
