"""Whether the measures see what they are for: ``python scripts/validate_measures.py``.

Each texture is cut in quarters. The upper left one is the exemplar, and the lower right one a real crop: the
best that synthesis can do. What spoils the real crop, or repeats the exemplar, has to be ranked behind it:

- its patch distance has to be less than those of itself blurred, with its pixels shuffled, as noise with random
  phases and the same spectrum, and of another texture;
- it has to be nearer to the sharpness of the exemplar than itself blurred or shuffled, and nearer to its
  gradients than those two and the noise;
- a quarter of the exemplar laid 2x2 has to show more copies and repetition than the real crop, and less
  coverage than the whole exemplar (only copies have a source map; the real crop has none);
- seams are left out: a crop of a texture does not tile.

This was found for the built-in samples:

    patch distance    real crop  blurred  shuffled  noise  other texture  tiled exemplar
    brick                  0.49     0.81      2.61   2.14           5.91            0.64
    grass                  0.71     1.54      2.11   0.85           1.61            0.55
    gravel                 0.68     0.93      2.60   0.96           2.19            0.51
    pebbles                0.69     1.42      2.85   1.10           4.48            0.80

    sharpness         real crop  blurred  shuffled  noise  other texture  tiled exemplar
    brick                  0.98     0.68      4.12   1.52           4.75            1.06
    grass                  1.00     0.39      2.04   1.13           0.54            1.01
    gravel                 1.13     0.61      3.32   1.34           1.24            1.05
    pebbles                1.04     0.61      3.00   1.23           0.31            0.95

    gradient distance real crop  blurred  shuffled  noise  other texture  tiled exemplar
    brick                  0.08     0.35      3.12   0.83           3.75            0.08
    grass                  0.03     0.61      1.04   0.21           0.46            0.04
    gravel                 0.13     0.39      2.32   0.37           0.24            0.06
    pebbles                0.04     0.39      2.00   0.30           0.69            0.05

Copied and repetition are 0.00 for all but the tiled exemplar, which has 0.66 of both and a coverage of 0.25.

Everything is ranked as it should be there. With 21 other pictures of 34 to 640 pixels a side (regular,
irregular and smooth ones, in gray and in color), it is in so many cases:

- patch distance: blurred 19, shuffled 21, noise 20, other texture 21;
- sharpness: blurred 19, shuffled 21; gradient distance: blurred 19, shuffled 21, noise 20;
- copied and repetition: 20; coverage: 21.

Where they fail:

- Smooth pictures that change from place to place (clouds, water): the quarters are less alike than one of them
  and its blur, so that a blur is not seen, neither in the patches nor in the sharpness.
- Noise of nearly the same look: of the grass above, it has from 0.75 to 0.93 for 20 other seeds; of a picture of small flowers the noise has a patch distance of 0.74, and the
  real crop one of 0.98; the gradients of a rough stone wall are hardly those of another part of it.
- A blurred copy of the exemplar itself, and noise of the exemplar's own spectrum, have the exemplar's own coarse
  levels, and so are often closer to it than a real crop, in the mean of all levels: the real crop beats them on 4
  and 2 of the 4 samples, and on 14 and 14 of the 21 others. So look at the finest level and the sharpness too.
- Patches are small. Of a page of text (96x96 pixels of it) ``ashikhmin`` makes broken lines of broken words, with
  a patch distance of 0.71; ``wei_levoy`` nuts that melt together, with 1.12. Whether objects are whole and stand
  in line, only the eye sees.
- Copies of less than 11 pixels a side are not counted: a 17x17 exemplar tiled from 8x8 pixels has none. And in
  black and white nuts the real crop has equal windows by chance, a share of 0.12.
- A tiled exemplar has a patch distance of a real crop, or less: it consists of real patches. Only copying and
  repetition see it.
- Patch distances are in terms of how unlike the halves of an exemplar are. Regular textures have large ones for
  small faults, and uneven textures small ones for large faults: compare outputs for one exemplar.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import arguments
import torch

import torchsynth as ts
from torchsynth.metrics.report import Row
from torchsynth.pyramid import blur
from torchsynth.samples import PREFIX, SAMPLES

TEXTURES = [f"{PREFIX}{name}" for name in SAMPLES]
REAL, EXEMPLAR = "real crop", "exemplar itself"
BLURRED, SHUFFLED, NOISE = "blurred crop", "shuffled pixels", "phase noise"
OTHER, TILED = "other texture", "tiled exemplar"
BLURRED_EXEMPLAR, NOISE_OF_EXEMPLAR = "blurred exemplar", "exemplar's noise"
SHOWN = ("patch_distance", "sharpness", "gradient_distance", "copied", "repetition", "coverage")

_BLUR = 5


@dataclass(frozen=True)
class Purpose:
    """What a measure has to rank first, and before what.

    Args:
        first: The picture that has to win.
        beaten: The pictures it has to beat.
        fault: How bad a value of the measure is.
    """

    first: str
    beaten: tuple[str, ...]
    fault: Callable[[float], float]


PURPOSES = {
    "patch_distance": Purpose(REAL, (BLURRED, SHUFFLED, NOISE, OTHER), lambda value: value),
    "sharpness": Purpose(REAL, (BLURRED, SHUFFLED), lambda value: abs(value - 1)),
    "gradient_distance": Purpose(REAL, (BLURRED, SHUFFLED, NOISE), lambda value: value),
    "copied": Purpose(REAL, (TILED,), lambda value: value),
    "repetition": Purpose(REAL, (TILED,), lambda value: value),
    # Only copies have a source map: the real crop has none.
    "coverage": Purpose(EXEMPLAR, (TILED,), lambda value: -value),
}

HARDER = {
    "patch_distance": Purpose(REAL, (BLURRED_EXEMPLAR, NOISE_OF_EXEMPLAR), lambda value: value),
}
"""What the measure would see if it could: spoiled pictures that have much of this very exemplar in them."""


def crops(image: torch.Tensor, largest: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Two crops that share no pixel: the upper left quarter of a picture and the lower right one."""
    height, width = (min(side // 2, largest) for side in image.shape[1:])
    return image[:, :height, :width], image[:, -height:, -width:]


def blurred(image: torch.Tensor) -> torch.Tensor:
    """The picture under a binomial blur of 5x5 pixels."""
    return blur(image.unsqueeze(0), _BLUR, "reflect")[0]


def shuffled(image: torch.Tensor, seed: int = 0) -> torch.Tensor:
    """The same pixels in random order."""
    pixels = image.flatten(1)
    order = torch.randperm(pixels.shape[1], generator=torch.Generator().manual_seed(seed))
    return pixels[:, order].view_as(image)


def phase_noise(image: torch.Tensor, seed: int = 0) -> torch.Tensor:
    """Noise with the picture's spectrum: the phases are random, the same ones for all channels."""
    generator = torch.Generator().manual_seed(seed)
    noise = torch.fft.fft2(torch.randn(image.shape[1:], generator=generator, dtype=torch.float64))
    phases = noise / noise.abs()
    phases[0, 0] = 1
    changed: torch.Tensor = torch.fft.ifft2(torch.fft.fft2(image.double()) * phases).real
    return changed.to(image.dtype).clamp(0, 1)


def tiled(exemplar: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """A quarter of the exemplar laid side by side until it is as large again, and its source map."""
    height, width = exemplar.shape[1:]
    rows, columns = torch.arange(height) % (height // 2), torch.arange(width) % (width // 2)
    source = torch.stack(torch.meshgrid(rows, columns, indexing="ij"))
    return exemplar[:, source[0], source[1]], source


def like(exemplar: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
    """A crop of another texture, with as many channels, and no larger."""
    crop = other[:, : exemplar.shape[1], : exemplar.shape[2]]
    return crop if len(crop) == len(exemplar) else crop.mean(0, keepdim=True).expand(len(exemplar), -1, -1)


def rows_of(image: torch.Tensor, other: torch.Tensor, largest: int) -> dict[str, Row]:
    """The measures of a real crop of a texture, and of all that it has to beat."""
    exemplar, real = crops(image, largest)
    tiles, source = tiled(exemplar)
    every = torch.stack(torch.meshgrid(*map(torch.arange, exemplar.shape[1:]), indexing="ij"))
    pictures = {
        REAL: real,
        BLURRED: blurred(real),
        SHUFFLED: shuffled(real),
        NOISE: phase_noise(real),
        OTHER: like(exemplar, other),
        BLURRED_EXEMPLAR: blurred(exemplar),
        NOISE_OF_EXEMPLAR: phase_noise(exemplar),
    }
    rows = {name: ts.metrics.measure(picture, exemplar).rows()[0] for name, picture in pictures.items()}
    rows[TILED] = ts.metrics.measure(tiles, exemplar, source).rows()[0]
    rows[EXEMPLAR] = ts.metrics.measure(exemplar, exemplar, every).rows()[0]
    return rows


def losses(rows: dict[str, Row], measure: str, purpose: Purpose) -> list[str]:
    """What a measure does not rank behind the picture that has to win."""

    def fault(picture: str) -> float:
        value = rows[picture][measure]
        assert isinstance(value, float)  # noqa: S101 (for the type checker)
        return purpose.fault(value)

    return [rival for rival in purpose.beaten if fault(purpose.first) >= fault(rival)]


def table(found: dict[str, dict[str, Row]]) -> list[list[str]]:
    """A line for each texture and picture, under a line of headings."""
    lines = [["texture", "picture", *(name.replace("_", " ") for name in SHOWN)]]
    for texture, rows in found.items():
        for picture, row in rows.items():
            cells = (row[name] for name in SHOWN)
            lines.append([texture, picture, *("-" if cell is None else f"{cell:.2f}" for cell in cells)])
    return lines


def summary(found: dict[str, dict[str, Row]]) -> list[str]:
    """How often each measure does what it is for, and where it does not."""
    lines = []
    for measure, purpose in [*PURPOSES.items(), *HARDER.items()]:
        lost = {texture: losses(rows, measure, purpose) for texture, rows in found.items()}
        for rival in purpose.beaten:
            where = [texture for texture, rivals in lost.items() if rival in rivals]
            won = f"{len(found) - len(where)} of {len(found)}"
            line = f"{measure.replace('_', ' ')}: the {purpose.first} beats the {rival} on {won}"
            lines.append(line + (f", not on {', '.join(where)}" if where else ""))
    return lines


def aligned(lines: Sequence[Sequence[str]]) -> str:
    """A table as text."""
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    padded = (
        [cell.ljust(width) if place < 2 else cell.rjust(width) for place, (cell, width) in enumerate(pairs)]
        for pairs in (zip(line, widths, strict=True) for line in lines)
    )
    return "\n".join("  ".join(line).rstrip() for line in padded)


def write(lines: Sequence[Sequence[str]], notes: Sequence[str], path: Path) -> None:
    """The table as CSV, or with the summary as Markdown."""
    with path.open("w", encoding="utf-8", newline="") as file:
        if path.suffix.lower() == ".csv":
            csv.writer(file, lineterminator="\n").writerows(lines)
            return
        ruled = [lines[0], ["---"] * len(lines[0]), *lines[1:]]
        file.writelines(f"| {' | '.join(line)} |\n" for line in ruled)
        file.writelines(["\n", *(f"- {note}\n" for note in notes)])


def picture(name: str) -> torch.Tensor:
    """A texture without its alpha channel."""
    image = ts.read_image(name)
    return image[:-1] if len(image) in (2, 4) else image


def table_to_write(text: str) -> Path:
    """A file whose name says how a table is written."""
    path = arguments.file_to_write(text)
    if path.suffix.lower() not in (".csv", ".md"):
        raise argparse.ArgumentTypeError(f"must end in .csv or .md, but it is {path}")
    return path


def check_sizes(images: dict[str, torch.Tensor]) -> None:
    """Every quarter has to be large enough, before the first is measured."""
    least = 2 * ts.metrics.SMALLEST_SIDE
    for name, image in images.items():
        height, width = image.shape[1:]
        if min(height, width) < least:
            raise ts.InputError(
                name, f"must have at least {least} pixels a side to be cut in quarters",
                f"it is {height}x{width}", "leave it out",
            )  # fmt: skip


def check_textures(textures: Sequence[str]) -> None:
    """There has to be another texture for each, and a name of its own in the table."""
    if len(set(textures)) < max(2, len(textures)):
        raise ts.InputError(
            "textures", "must be two or more, all different", f"they are {' '.join(textures)}", "give others"
        )


def main() -> None:
    """Measure, print the table and say who wins."""
    parser = argparse.ArgumentParser(description="Whether the measures see what they are for.")
    names = f"two or more files, or sample:NAME; default: {' '.join(TEXTURES)}"
    parser.add_argument("--textures", nargs="+", default=TEXTURES, metavar="TEXTURE", help=names)
    largest = "the most pixels a side of a crop, which is at most a quarter of its picture; default: 192"
    parser.add_argument(
        "--crop", type=arguments.whole_number(14), default=192, metavar="PIXELS", help=largest
    )
    parser.add_argument("--out", type=table_to_write, help="also write the table here, as .csv or .md")
    options = parser.parse_args()
    with arguments.one_line_errors(parser):
        check_textures(options.textures)
        images = {name: picture(name) for name in options.textures}
        check_sizes(images)
        others = [*options.textures[1:], options.textures[0]]
        found = {
            name: rows_of(images[name], images[other], options.crop)
            for name, other in zip(options.textures, others, strict=True)
        }
        lines, notes = table(found), summary(found)
        print(aligned(lines), *notes, sep="\n")
        if options.out is not None:
            write(lines, notes, options.out)


if __name__ == "__main__":
    main()
