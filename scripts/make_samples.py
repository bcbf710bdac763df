"""Make the built-in samples again: ``python scripts/make_samples.py torchsynth/data``.

Needs scikit-image and pooch (``pip install scikit-image pooch``): the wheel of the former holds the CC0
textures that three of the samples are cropped from. The colored pebbles are computed here.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import arguments
import numpy as np
from numpy.typing import NDArray
from PIL import Image

SIDE = 128
CROPS = {"brick": (0, 384), "grass": (256, 384), "gravel": (128, 128)}
COLORS = np.array(
    [[168, 138, 108], [120, 112, 104], [196, 182, 160], [142, 92, 70], [94, 98, 106], [178, 160, 128]]
)


def pebbles(side: int, count: int, seed: int) -> NDArray[np.uint8]:
    """Rounded stones on dark ground, lit from the upper left: cells of jittered points, which tile."""
    random = np.random.default_rng(seed)
    across = int(count**0.5)
    grid = np.stack(np.meshgrid(np.arange(across), np.arange(across)), -1).reshape(-1, 2)
    centers = (grid + 0.5 + random.uniform(-0.38, 0.38, grid.shape)) * side / across
    stretch = random.uniform(0.75, 1.3, (len(centers), 1))
    tone = COLORS[random.integers(0, len(COLORS), len(centers))] * random.uniform(
        0.85, 1.12, (len(centers), 1)
    )
    rows, columns = np.mgrid[:side, :side] + 0.5
    offsets = np.stack((rows[..., None] - centers[:, 0], columns[..., None] - centers[:, 1]))
    offsets = (offsets + side / 2) % side - side / 2
    distance = np.hypot(offsets[0] * stretch[:, 0], offsets[1] / stretch[:, 0])
    first, second = np.partition(distance, 1, axis=2)[..., :2].transpose(2, 0, 1)
    stone = distance.argmin(2)
    # Height of a stone: 0 at the joint, rising quickly and then flat.
    height = 1 - np.exp(-((second - first) / 2.6))
    down, right = np.gradient(height)
    light = 0.86 + 0.5 * height * 0.3 - 0.9 * (down + right)
    color = tone[stone] * light[..., None] + random.normal(0, 4, (side, side, 1))
    ground = np.array([46, 40, 36])
    shown = ground + (color - ground) * np.clip(height * 1.5 - 0.25, 0, 1)[..., None]
    pixels: NDArray[np.uint8] = shown.clip(0, 255).round().astype(np.uint8)
    return pixels


def make(folder: Path) -> None:
    """Write the four samples to a folder."""
    try:
        import pooch  # noqa: F401 (scikit-image needs it to find its own files)
        from skimage import data
    except ModuleNotFoundError as error:
        raise SystemExit(f"{error}; run: pip install scikit-image pooch") from None

    folder.mkdir(parents=True, exist_ok=True)
    for name, (row, column) in CROPS.items():
        picture = getattr(data, name)()[row : row + SIDE, column : column + SIDE]
        Image.fromarray(picture).save(folder / f"{name}.png", optimize=True)
    Image.fromarray(pebbles(SIDE, 121, seed=4)).save(folder / "pebbles.png", optimize=True)


def main() -> None:
    """Make the samples."""
    parser = argparse.ArgumentParser(description="Make the built-in samples again.")
    parser.add_argument("folder", type=Path, help="the folder to write to")
    options = parser.parse_args()
    with arguments.one_line_errors(parser):
        make(options.folder)


if __name__ == "__main__":
    main()
