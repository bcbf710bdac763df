"""Make every picture of the README again: ``python scripts/gallery.py --out docs/images``.

Only built-in samples, the public functions and the seeds written here are used, so each run gives the
same textures. The pictures are saved as JPEG to keep the repository small; synthesis itself is lossless.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import arguments
import efros_leung_windows
import gallery_figures
import gallery_guided
import gallery_patches
import numpy as np
import torch
from layout import Pixels, enlarged, framed, in_a_column, in_a_row, labelled, shown
from PIL import Image

import torchsynth as ts

RECIPES = Path(__file__).parent.parent / "docs" / "recipes"


def strip() -> Pixels:
    """Each built-in sample beside a 256x256 texture made from it."""
    pairs = []
    for name in ("brick", "grass", "pebbles", "gravel"):
        sample = ts.read_image(f"sample:{name}")
        pairs.append(in_a_row([shown(sample), texture(sample, 256, 256)]))
    return in_a_column([in_a_row(pairs[:2]), in_a_row(pairs[2:])])


def larger() -> Pixels:
    """A sample, and a texture of three times its area and another shape."""
    sample = ts.read_image("sample:brick")
    return in_a_row([shown(sample), texture(sample, 192, 512)])


def resolutions() -> Pixels:
    """A sample; the same 9x9 neighborhood on one pyramid level, and on four."""
    sample = ts.read_image("sample:brick")
    single = ts.recipes.wei_levoy_single(neighborhood=9)
    multi = ts.recipes.wei_levoy(neighborhood=9)
    return in_a_row([shown(sample), *(texture(sample, 256, 256, recipe) for recipe in (single, multi))])


def tiles() -> Pixels:
    """Outputs laid 2x2: open border, torus, torus with a second pass, and Ashikhmin's mended torus."""
    sample = ts.read_image("sample:pebbles")
    recipes = (
        ts.recipes.wei_levoy(boundary="open"),
        ts.recipes.wei_levoy(boundary="torus"),
        ts.load_recipe(RECIPES / "two_pass.yaml"),
        ts.recipes.ashikhmin(),
    )
    return in_a_row([np.tile(texture(sample, 128, 128, recipe), (2, 2, 1)) for recipe in recipes])


def seeds() -> Pixels:
    """Four seeds of one sample, made in one batch."""
    sample = ts.read_image("sample:brick")
    result = ts.synthesize(sample, (192, 192), ts.recipes.wei_levoy(), seed=[0, 1, 2, 3])
    return in_a_row([shown(image) for image in result.image])


def transfer() -> Pixels:
    """A sample with labels, normals and coordinates made for it (above), and all of them carried over."""
    sample = ts.read_image("sample:brick")
    result = ts.synthesize(sample, (192, 192), ts.recipes.wei_levoy(), seed=0)
    maps = (sample, mortar(sample), normals(sample), coordinates(*sample.shape[1:]))
    rows = [[shown(one) for one in maps], [shown(result.transfer(one)[0]) for one in maps]]
    wide = rows[1][0].shape[1]
    padded = [framed(picture, picture.shape[0], wide) for picture in rows[0]]
    return in_a_column([in_a_row(padded), in_a_row(rows[1])])


def levels() -> Pixels:
    """The levels of one result, from the coarsest to the finest, enlarged to one size."""
    sample = ts.read_image("sample:brick")
    result = ts.synthesize(sample, (192, 192), ts.recipes.wei_levoy(), seed=0)
    return in_a_row([enlarged(shown(level.image[0]), 192) for level in reversed(result.levels)])


def initial() -> Pixels:
    """A sample, a picture to start from, and the picture in the sample's texture."""
    sample, start = ts.read_image("sample:pebbles"), ring(192)
    recipe = ts.load_recipe(RECIPES / "restyle.yaml")
    return in_a_row([shown(sample), shown(start), texture(sample, 192, 192, recipe, ts.Controls(start))])


def region() -> Pixels:
    """A sample with two materials, a texture of all of it, and one of its left half only."""
    gravel, brick = (ts.read_image(f"sample:{name}") for name in ("gravel", "brick"))
    sample = torch.cat((gravel[:, :, :96], brick[:, :, :96]), dim=2)
    left = torch.arange(192).expand(128, 192) < 96
    recipe = ts.recipes.wei_levoy(levels=3)
    both = [texture(one, 192, 192, recipe) for one in (sample, ts.Exemplar(sample, left))]
    return in_a_row([shown(sample), *both])


def algorithms() -> Pixels:
    """Each built-in sample; its texture by Wei-Levoy, by Ashikhmin, and by Ashikhmin on three levels."""
    recipes = (ts.recipes.wei_levoy(), ts.recipes.ashikhmin(), ts.recipes.ashikhmin_multires())
    rows = []
    for name in ("gravel", "grass", "pebbles", "brick"):
        sample = ts.read_image(f"sample:{name}")
        rows.append(in_a_row([shown(sample), *(texture(sample, 128, 128, recipe) for recipe in recipes)]))
    return in_a_row([in_a_column(rows[:2]), in_a_column(rows[2:])])


def patches() -> Pixels:
    """A sample, an output, its patches, their sources and the key to them; a part of it, plain and blurred."""
    sample = ts.read_image("sample:pebbles")
    recipe = ts.recipes.ashikhmin()
    plain = ts.synthesize(sample, (128, 128), recipe, seed=0)
    blurred = texture(sample, 128, 128, ts.recipes.ashikhmin(blur_seams=3))
    output, drawn, sources = (
        shown(one[0]) for one in (plain.image, ts.viz.draw_patches(plain), ts.viz.draw_sources(plain))
    )
    near = [enlarged(one[72:104, 76:108], 128) for one in (output, blurred)]
    return in_a_row([shown(sample), output, drawn, source_colors(128, 128), sources, *near])


def target() -> Pixels:
    """Samples, painted rings, and outputs: one pass, five, Wei-Levoy, and only the ring painted."""
    followed = ts.recipes.with_target(ts.recipes.wei_levoy())
    once, often = (ts.recipes.ashikhmin_target(passes=passes) for passes in (1, 5))
    colors = {"pebbles": ((0.28, 0.33, 0.42), (0.78, 0.68, 0.50)), "grass": ((0.30,), (0.68,))}
    rows = []
    for name, (ground, figure) in colors.items():
        sample, region = ts.read_image(f"sample:{name}"), on_ring(128)
        painted = torch.where(region, as_color(figure), as_color(ground))
        everywhere, there = ts.Controls(target=painted), ts.Controls(target=painted, target_region=region)
        wishes = ((once, everywhere), (often, everywhere), (followed, everywhere), (often, there))
        outputs = [texture(sample, 128, 128, recipe, controls) for recipe, controls in wishes]
        rows.append(in_a_row([shown(sample), shown(painted), *outputs]))
    return in_a_column(rows)


def fields() -> Pixels:
    """Brick turned by 45 degrees and by a swirl, pebbles by a zoom and twice as large; with each its field."""
    shape = (144, 144)
    wishes = {
        "brick": (ts.Controls(angle=45.0), ts.Controls(angle=ts.field.swirl(shape, 180.0))),
        "pebbles": (ts.Controls(scale=ts.field.zoom(shape, 0.5, 1.5)), ts.Controls(scale=2.0)),
    }
    rows = []
    for name, controls in wishes.items():
        sample = ts.read_image(f"sample:{name}")
        row = [shown(sample)]
        for one in controls:
            drawn = ts.viz.draw_field(one.angle, one.scale, shape)[0]
            row += [shown(drawn), texture(sample, *shape, ts.recipes.distorted(), one)]
        rows.append(in_a_row(row))
    return in_a_column(rows)


def filling() -> Pixels:
    """Samples, the same with two holes, and the holes filled by three recipes."""
    recipes = (ts.recipes.coherent_fill(), ts.recipes.efros_leung(), ts.recipes.wei_levoy_fill())
    hole, rows = disc_and_scratch(128), []
    for name in ("brick", "grass", "gravel"):
        sample = ts.read_image(f"sample:{name}")
        outputs = [shown(ts.fill(sample, hole, recipe=recipe).image[0]) for recipe in recipes]
        rows.append(in_a_row([shown(sample), shown(marked(sample, hole)), *outputs]))
    heads = ("sample", "holes", *(recipe.name for recipe in recipes))
    blank = np.ones((0, 128, 3), dtype=np.float32)
    return in_a_column([in_a_row([labelled(blank, head) for head in heads]), *rows])


def removal() -> Pixels:
    """A ball on grass and a ring sprayed on a wall: pictures, what was marked, and what is left."""
    pieces = []
    for picture, region in (ball_on_grass(), sprayed_wall()):
        cleaned = ts.fill(picture, region).image[0]
        pieces += [shown(picture), shown(marked(picture, region)), shown(cleaned)]
    return in_a_row(pieces)


def extended() -> Pixels:
    """Samples, and the same in the middle of more; the wall by two recipes."""
    brick, pebbles = (ts.read_image(f"sample:{name}") for name in ("brick", "pebbles"))
    wishes = (
        (brick, ts.recipes.coherent_fill()),
        (brick, ts.recipes.efros_leung()),
        (pebbles, ts.recipes.coherent_fill()),
    )
    outputs = [shown(ts.extend(sample, (192, 192), recipe=recipe).image[0]) for sample, recipe in wishes]
    return in_a_row([shown(brick), *outputs[:2], shown(pebbles), outputs[2]])


def tiled() -> Pixels:
    """Samples laid 2x2 as they are, and after a strip along their borders was made anew."""
    pieces = []
    for name in ("gravel", "grass"):
        sample = ts.read_image(f"sample:{name}")
        mended = ts.tile(sample, width=24).image[0]
        pieces += [np.tile(shown(one), (2, 2, 1)) for one in (sample, mended)]
    return in_a_row(pieces)


def windows() -> Pixels:
    """Rings, bricks and pebbles, and what grows from them with windows of four widths."""
    part = (96, 96)
    names = (efros_leung_windows.RINGS, "sample:brick", "sample:pebbles")
    images = [efros_leung_windows.picture(name, part) for name in names]
    return efros_leung_windows.figure(images, efros_leung_windows.WINDOWS, part)


PICTURES: tuple[Callable[[], Pixels], ...] = (
    strip, larger, resolutions, algorithms, patches, tiles, seeds, transfer, levels, initial, target, fields,
    region, filling, removal, extended, tiled, windows, gallery_guided.objects, gallery_guided.analogies,
    gallery_figures.figures, gallery_patches.whole,
)  # fmt: skip


def texture(
    exemplar: torch.Tensor | ts.Exemplar,
    height: int,
    width: int,
    recipe: ts.Recipe | None = None,
    controls: ts.Controls | None = None,
) -> Pixels:
    """Synthesize one texture with seed 0, by Wei-Levoy with four levels if nothing else is said."""
    recipe = recipe or ts.recipes.wei_levoy()
    return shown(ts.synthesize(exemplar, (height, width), recipe, controls=controls, seed=0).image[0])


def mortar(sample: torch.Tensor) -> torch.Tensor:
    """Labels of the brick sample, as colors: the brighter pixels are mortar."""
    colors = torch.tensor([[0.58, 0.20, 0.16], [0.93, 0.88, 0.74]])
    labels: torch.Tensor = (sample[0] > 0.46).long()
    return colors[labels].permute(2, 0, 1)


def normals(sample: torch.Tensor) -> torch.Tensor:
    """Surface normals, as colors, of a sample whose brightness is taken for height."""
    down, right = torch.gradient(sample[0] * 6)
    directions = torch.stack((-right, down, torch.ones_like(down)))
    return torch.nn.functional.normalize(directions, dim=0) / 2 + 0.5


def coordinates(height: int, width: int) -> torch.Tensor:
    """Each pixel's own place as a color: red grows to the right, green downwards."""
    down, right = torch.meshgrid(torch.linspace(0, 1, height), torch.linspace(0, 1, width), indexing="ij")
    return torch.stack((right, down, torch.full_like(down, 0.5)))


def source_colors(height: int, width: int) -> Pixels:
    """The color that a drawing of sources gives each place of a sample of this size."""
    down, right = torch.meshgrid(torch.linspace(0, 1, height), torch.linspace(0, 1, width), indexing="ij")
    return shown(torch.stack((right, down, 1 - (right + down) / 2)))


def distances(side: int, row: float, column: float) -> torch.Tensor:
    """How far each pixel of a square picture is from a place in it, in pixels."""
    axis = torch.arange(float(side))
    return torch.hypot(axis[:, None] - row, axis - column)


def disc_and_scratch(side: int) -> torch.Tensor:
    """Two holes in a square picture: a disc, and a thin line across."""
    down, right = torch.meshgrid(torch.arange(side), torch.arange(side), indexing="ij")
    scratch = ((down - right - 40).abs() < 3) & (right < 80)
    return (distances(side, 44, 78) < 20) | scratch


def marked(picture: torch.Tensor, region: torch.Tensor) -> torch.Tensor:
    """The picture in gray or color with a region in magenta, which no sample has."""
    return torch.where(region, as_color((1.0, 0.0, 1.0)), picture.expand(3, -1, -1))


def ball_on_grass() -> tuple[torch.Tensor, torch.Tensor]:
    """The grass sample with a red ball and its shadow on it, and where they are."""
    grass = ts.read_image("sample:grass")
    light = (1 - distances(128, 50, 54) / 40).clamp(0.25, 1)
    ball, shadow = distances(128, 60, 62) < 20, distances(128, 74, 72) < 20
    picture = torch.where(shadow, 0.4 * grass, grass).expand(3, -1, -1)
    return torch.where(ball, light * as_color((0.95, 0.25, 0.2)), picture), ball | shadow


def sprayed_wall() -> tuple[torch.Tensor, torch.Tensor]:
    """The brick sample with a green ring painted on it, and where that is."""
    brick = ts.read_image("sample:brick")
    line = (distances(128, 64, 64) - 34).abs() < 5
    return torch.where(line, 0.3 * brick + as_color((0.1, 0.5, 0.2)), brick), line


def as_color(channels: Sequence[float]) -> torch.Tensor:
    """One color as a picture that fits any size."""
    return torch.tensor(channels).view(-1, 1, 1)


def on_ring(side: int) -> torch.Tensor:
    """Where a square picture shows a ring."""
    axis = torch.linspace(-1, 1, side)
    distance = torch.hypot(axis[:, None], axis[None])
    return (distance > 0.38) & (distance < 0.76)


def ring(side: int) -> torch.Tensor:
    """A light ring on darker ground, a little noisy: a made-up picture to start from."""
    flat = 0.3 + 0.4 * on_ring(side).float()
    noise = torch.rand(3, side, side, generator=torch.Generator().manual_seed(0)) - 0.5
    return (flat + 0.5 * noise).clamp(0, 1)


def save(picture: Pixels, path: Path) -> None:
    """Write a picture as JPEG."""
    pixels = (picture * 255).round().astype(np.uint8)
    Image.fromarray(pixels).save(path, quality=78, subsampling=0, optimize=True, progressive=True)


def main() -> None:
    """Make the pictures that are asked for, or all."""
    parser = argparse.ArgumentParser(description="Make the pictures of the README.")
    parser.add_argument("--out", type=Path, required=True, help="the folder to write to")
    names = [make.__name__ for make in PICTURES]
    parser.add_argument("--only", nargs="+", choices=names, default=names, metavar="NAME", help="which ones")
    options = parser.parse_args()
    with arguments.one_line_errors(parser):
        options.out.mkdir(parents=True, exist_ok=True)
        for make in PICTURES:
            if make.__name__ in options.only:
                path = options.out / f"{make.__name__}.jpg"
                save(make(), path)
                print(path, f"{path.stat().st_size // 1000} kB", flush=True)


if __name__ == "__main__":
    main()
