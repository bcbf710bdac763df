"""Take the README's picture of the studio, in a real browser.

It needs the extra ``studio``, playwright and Chromium. The picture shows a target that is painted with colors of the
sample, and the texture that followed it.
"""

from __future__ import annotations

import argparse
import io
import shutil
from collections.abc import Sequence
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

from torchsynth.studio.server import serving

_QUALITY = 80
_HEART = (
    (0.5, 0.32), (0.38, 0.2), (0.24, 0.22), (0.16, 0.36), (0.22, 0.52), (0.5, 0.84), (0.78, 0.52), (0.84, 0.36),
    (0.76, 0.22), (0.62, 0.2), (0.5, 0.32),
)  # fmt: skip


def main() -> None:
    """Take the picture."""
    parser = argparse.ArgumentParser(description="Take the README's picture of the studio.")
    parser.add_argument("--out", type=Path, default=Path("docs/images/studio.jpg"))
    parser.add_argument("--chromium", default=shutil.which("chromium"), help="the browser")
    parser.add_argument("--dark", action="store_true", help="in the dark")
    chosen = parser.parse_args()
    with serving(port=0) as address, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chosen.chromium, args=["--no-sandbox"])
        page = browser.new_page(
            viewport={"width": 1280, "height": 800}, color_scheme="dark" if chosen.dark else "light"
        )
        page.goto(address)
        page.wait_for_selector("#sample img")
        paint_and_run(page)
        picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        browser.close()
    picture.save(chosen.out, quality=_QUALITY, optimize=True)
    print(chosen.out)


def paint_and_run(page: Page) -> None:
    """A heart in a bright color on a dark one, and three passes that follow it."""
    page.click("button[role=tab]:has-text('Target')")
    page.wait_for_selector("#target .swatch")
    page.fill("#target input[type=range]", "48")
    page.locator("#target .swatch").nth(1).click()
    for row in range(1, 9):
        paint(page, ((0.0, row / 8 - 0.06), (1.0, row / 8 - 0.06)))
    page.fill("#target input[type=range]", "14")
    page.locator("#target .swatch").last.click()
    paint(page, _HEART)
    for button in ("first-pass", "one-more-pass", "one-more-pass"):
        page.evaluate("document.querySelector('#progress .said').className = 'said'")
        page.click(f"#{button}")
        page.wait_for_selector("#progress .said.done")
    page.wait_for_selector("#download-image:not([disabled])")
    page.wait_for_timeout(1000)


def paint(page: Page, points: Sequence[tuple[float, float]]) -> None:
    """One stroke through some points, given as shares of the canvas."""
    page.locator("#target canvas").scroll_into_view_if_needed()
    box = page.locator("#target canvas").bounding_box()
    assert box is not None, "it is shown"  # noqa: S101 (for the type checker)
    places = [(box["x"] + x * (box["width"] - 1), box["y"] + y * (box["height"] - 1)) for x, y in points]
    page.mouse.move(*places[0])
    page.mouse.down()
    for place in places[1:]:
        page.mouse.move(*place)
    page.mouse.up()


if __name__ == "__main__":
    main()
