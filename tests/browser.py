"""A real browser for the tests of pages, and what those pages asked for."""

from __future__ import annotations

import contextlib
import os
import shutil
from urllib.parse import urlsplit

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


def missing(reason):
    """Skip where there is no browser; where the checks of a release run, that is a failure."""
    if os.environ.get("CI") == "true":
        pytest.fail(f"no browser to test with: {reason}")
    pytest.skip(reason)


@pytest.fixture(scope="module")
def browser():
    """Chromium, without a window."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        missing("playwright is not installed")
    if CHROMIUM is None:
        missing("Chromium is not installed")
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield running
        running.close()


@pytest.fixture
def page(browser):
    """An empty page; ``page.requested`` lists the address of everything that it asks for."""
    opened = browser.new_page(viewport={"width": 1200, "height": 900})
    opened.requested = []
    opened.on("request", lambda request: opened.requested.append(request.url))
    opened.set_default_timeout(45_000)
    yield opened
    opened.close()


def hosts(page):
    """The hosts that a page asked; what it made itself (data:, blob:) has none."""
    return {urlsplit(url).hostname for url in page.requested if url.startswith(("http", "ws"))}


@contextlib.contextmanager
def served(blocks, **options):
    """The address at which a gradio page is served on this machine, for as long as it is needed."""
    _, url, _ = blocks.launch(
        server_name="127.0.0.1", prevent_thread_lock=True, quiet=True, footer_links=[], **options
    )
    try:
        yield url
    finally:
        blocks.close(verbose=False)
