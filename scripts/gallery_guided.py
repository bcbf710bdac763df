"""The gallery's pictures of the improved Wei-Levoy algorithm and of image analogies; see gallery.py."""

from __future__ import annotations

import torch
from kornia.filters import sobel
from layout import Pixels, in_a_column, in_a_row, labelled, shown

import torchsynth as ts


def objects() -> Pixels:
    """Samples of irregular objects; Wei-Levoy, and with weighting, non-causal passes and morphology added."""
    improved = ts.recipes.improved_wl
    recipes = {
        "wei_levoy": ts.recipes.wei_levoy(),
        "W": improved(noncausal=False, morphology=False),
        "W+N": improved(morphology=False),
        "W+N+M": improved(),
    }
    rows: list[Pixels] = []
    for name in ("gravel", "pebbles", "brick"):
        sample = ts.read_image(f"sample:{name}")
        outputs = {
            label: shown(ts.synthesize(sample, (128, 128), recipe).image[0])
            for label, recipe in recipes.items()
        }
        pictures = {"sample": shown(sample), **outputs}
        rows.append(
            in_a_row(
                list(pictures.values()) if rows else [labelled(one, head) for head, one in pictures.items()]
            )
        )
    return in_a_column(rows)


def analogies() -> Pixels:
    """A drawing learned from pebbles and carried over to gravel; and a texture painted by numbers."""
    pebbles = ts.read_image("sample:pebbles").mean(0, keepdim=True)
    gravel = ts.read_image("sample:gravel")
    drawn = drawing(pebbles)
    filtered = ts.analogy(pebbles, drawn, gravel).image[0]
    labels, both, wanted = painting_by_numbers()
    recipe = ts.recipes.analogy(neighborhood=9, parent=5, guide=3, coarse_guide=1, guide_weight=4, kappa=10.0)
    painted = ts.analogy(labels, both, wanted, recipe).image[0]
    return in_a_column(
        [
            in_a_row([labelled(shown(one), head) for one, head in zip(row, heads, strict=True)])
            for row, heads in (
                ((pebbles, drawn, gravel, filtered), ("A", "A'", "B", "B'")),
                ((as_picture(labels), both, as_picture(wanted), painted), ("A", "A'", "B", "B'")),
            )
        ]
    )


def drawing(picture: torch.Tensor) -> torch.Tensor:
    """A gray picture as dark lines on white: a simple filter, to be learned."""
    edges: torch.Tensor = sobel(picture[None])[0]
    return (1 - 4 * edges).clamp(0, 1)


def painting_by_numbers() -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Labels of a sample of two materials, the sample, and the labels of what is to be painted: a ring."""
    halves = [ts.read_image(f"sample:{name}")[:, :, :96] for name in ("gravel", "brick")]
    labels = (torch.arange(192) >= 96).long().expand(128, 192).contiguous()
    axis = torch.linspace(-1, 1, 128)
    distance = torch.hypot(axis[:, None], axis[None])
    wanted = ((distance > 0.35) & (distance < 0.8)).long()
    return labels, torch.cat(halves, dim=2), wanted


def as_picture(labels: torch.Tensor) -> torch.Tensor:
    """A map of two labels in two grays."""
    return 0.3 + 0.4 * labels.float().unsqueeze(0)
