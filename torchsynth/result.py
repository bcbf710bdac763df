"""What synthesis returns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import torch
from jaxtyping import Bool
from torch import Tensor

from torchsynth._typing import CostMap, Image, SourceMap
from torchsynth.errors import InputError
from torchsynth.lattice import Boundary, Shape
from torchsynth.recipe import Recipe

_SAME_WIDTH = {torch.uint16: torch.int16, torch.uint32: torch.int32, torch.uint64: torch.int64}


@dataclass(frozen=True)
class Level:
    """One finished pyramid level.

    Args:
        exemplar: The exemplar at this level.
        start: What the output showed before the level's first sweep.
        image: The finished output.
        source: Where in the exemplar's level each pixel was copied from.
        cost: Mean squared difference per compared value, in squared units of [0, 1].
    """

    exemplar: Image
    start: Image
    image: Image
    source: SourceMap
    cost: CostMap


@dataclass(frozen=True)
class Result:
    """A finished synthesis. For every pixel ``image == exemplar[source]``, exactly.

    There are exceptions: the image of a recipe that blurs its seams; and pixels that have no source (-1), as
    they show a centroid of TSVQ (``leaf: centroid``), were given around a hole, or are made channel by channel.

    Args:
        levels: All pyramid levels, the finest first.
        recipe: How it was made.
        seeds: One for each sample.
        distorted: Whether a field turned or scaled the neighborhoods.
        structure: The texture that guided the synthesis, where the recipe makes one; see
            :class:`torchsynth.Structure`.

    Example:
        >>> import torch, torchsynth as ts
        >>> result = ts.synthesize(torch.rand(3, 24, 24), (16, 20), ts.recipes.wei_levoy(levels=1))
        >>> tuple(result.image.shape), tuple(result.source.shape), tuple(result.cost.shape)
        ((1, 3, 16, 20), (1, 2, 16, 20), (1, 16, 20))
    """

    levels: tuple[Level, ...]
    recipe: Recipe
    seeds: tuple[int, ...]
    distorted: bool = False
    structure: Result | None = None

    @classmethod
    def joined(cls, results: Sequence[Result]) -> Result:
        """Several results of one size as one, in their order, with the levels that all of them have.

        The recipe is the first one's.

        Example:
            >>> import torch, torchsynth as ts
            >>> recipe = ts.recipes.ashikhmin()
            >>> two = [ts.synthesize(torch.rand(1, 9, 9), (4, 4), recipe, seed=seed) for seed in (1, 2)]
            >>> Result.joined(two).seeds
            (1, 2)
        """
        names = [one.name for one in fields(Level)]
        levels = [
            Level(*(torch.cat([getattr(level, name) for level in alike]) for name in names))
            for alike in zip(*(result.levels for result in results), strict=False)
        ]
        seeds = tuple(seed for result in results for seed in result.seeds)
        structures = [result.structure for result in results if result.structure is not None]
        structure = cls.joined(structures) if structures else None
        return cls(tuple(levels), results[0].recipe, seeds, results[0].distorted, structure)

    @classmethod
    def of_channels(cls, results: Sequence[Result], recipe: Recipe) -> Result:
        """Results for single channels as one for all of them, in their order; without sources."""
        levels = []
        for alike in zip(*(result.levels for result in results), strict=True):
            exemplar, start, image = (
                torch.cat([getattr(level, name) for level in alike], dim=1)
                for name in ("exemplar", "start", "image")
            )
            cost = torch.stack([level.cost for level in alike]).mean(0)
            levels.append(Level(exemplar, start, image, torch.full_like(alike[0].source, -1), cost))
        return cls(tuple(levels), recipe, results[0].seeds, results[0].distorted)

    @property
    def image(self) -> Image:
        """The synthesized pictures, ``(B, C, OH, OW)``, in the exemplar's dtype."""
        return self.levels[0].image

    @property
    def source(self) -> SourceMap:
        """``(B, 2, OH, OW)``: the exemplar's row and column each pixel was copied from.

        Pixels whose value is a TSVQ centroid come from nowhere: -1; as do those known around a hole that is
        filled from another picture.
        """
        return self.levels[0].source

    @property
    def cost(self) -> CostMap:
        """``(B, OH, OW)``: how badly each pixel's neighborhood fitted its match (0: perfectly)."""
        return self.levels[0].cost

    def seams(self) -> Bool[Tensor, "batch height width"]:
        """Where patches end, ``(B, OH, OW)``.

        True where the pixel to the right was not copied from the place to the right of this pixel's
        source, or the pixel below not from the place below it. On a torus the last column and row are
        compared with the first ones.

        Source: Ashikhmin 2001, figure 5.

        Example:
            >>> import torch, torchsynth as ts
            >>> result = ts.synthesize(torch.rand(1, 16, 16), (8, 8), ts.recipes.ashikhmin())
            >>> result.seams().shape
            torch.Size([1, 8, 8])
        """
        self._check_sources("seams")
        check_straight("seams", self.distorted)
        return seams(self.source, self.recipe.boundary)

    def transfer(self, other: Tensor) -> Tensor:
        """Copy from another picture that is aligned with the exemplar, through the same source map.

        Args:
            other: ``(C', H, W)`` of the exemplar's height and width, or a batch of one for each
                output; any dtype and number of channels: normals, heights, labels, 16-bit values.

        Returns:
            ``(B, C', OH, OW)`` in the dtype of ``other``.

        Raises:
            InputError: If its height and width are not the exemplar's, or its batch not the output's.

        Example:
            >>> import torch, torchsynth as ts
            >>> exemplar = torch.rand(1, 16, 16)
            >>> result = ts.synthesize(exemplar, (8, 8), ts.recipes.wei_levoy(levels=1))
            >>> bool((result.transfer(exemplar) == result.image).all())
            True
        """
        self._check_sources("transfer")
        shape = self.levels[0].exemplar.shape[-2:]
        return transfer(self.source, other, (shape[0], shape[1]))

    def _check_sources(self, wish: str) -> None:
        check_sources(self.recipe, wish)


def check_sources(recipe: Recipe, wish: str) -> None:
    """What needs a source map can be had only of recipes whose outputs are copies.

    Args:
        recipe: The recipe.
        wish: What is asked for.

    Raises:
        InputError: If the recipe makes values of its own.

    Example:
        >>> from torchsynth import recipes
        >>> check_sources(recipes.wei_levoy(), "transfer")
    """
    if recipe.channels == "separate":
        raise InputError(
            wish, "needs a source map, and so a recipe that copies pixels",
            f"the recipe {recipe.name!r} copies each channel from somewhere else", "use 'joint' channels",
        )  # fmt: skip
    if not recipe.has_sources:
        raise InputError(
            wish, "needs a source map, and so a recipe that copies pixels",
            f"leaves of the recipe {recipe.name!r} propose centroids",
            "use 'nearest' or 'central' leaves",
        )  # fmt: skip


def check_straight(wish: str, distorted: bool) -> None:
    """Patches are continued straight on only where no field turns or scales them.

    Raises:
        InputError: If one does.

    Example:
        >>> check_straight("seams", distorted=False)
    """
    if distorted:
        raise InputError(
            wish, "needs an output that is neither turned nor scaled", "a field distorts it",
            "leave out angle and scale",
        )  # fmt: skip


def seams(source: SourceMap, boundary: Boundary) -> Bool[Tensor, "batch height width"]:
    """Where the patches of a source map end; see :meth:`torchsynth.Result.seams`.

    Example:
        >>> source = torch.tensor([[[[0, 0, 0]], [[1, 2, 9]]]])
        >>> seams(source, "open").tolist()
        [[[False, True, False]]]
    """
    below, right = breaks(source, boundary)
    return below | right


def breaks(source: SourceMap, boundary: Boundary) -> tuple[Tensor, Tensor]:
    """Where a pixel's patch does not go on below it, and where it does not go on to its right.

    Example:
        >>> breaks(torch.tensor([[[[0, 0, 0]], [[1, 2, 9]]]]), "open")[1].tolist()
        [[[False, True, False]]]
    """
    found = []
    for axis in (0, 1):
        expected = source.clone()
        expected[:, axis] += 1
        after = source.roll(-1, axis + 2)
        # Between two pixels without source there is nothing to see.
        broken = (after != expected).any(1) & ~((after < 0) & (source < 0)).any(1)
        if boundary == "open":
            broken.select(axis + 1, -1).fill_(False)
        found.append(broken)
    return found[0], found[1]


def transfer(source: SourceMap, other: Tensor, exemplar_shape: Shape) -> Tensor:
    """Copy from a picture aligned with the exemplar, through a source map.

    Args:
        source: The map, ``(B, 2, OH, OW)``.
        other: ``(C, H, W)``, or ``(B, C, H, W)`` for one picture each; any dtype.
        exemplar_shape: Height and width that the map refers to.

    Raises:
        InputError: If the picture is not aligned with the exemplar.

    Example:
        >>> import torch
        >>> labels = torch.tensor([[[4, 5], [6, 7]]])
        >>> transfer(torch.tensor([[[[1, 0]], [[1, 1]]]]), labels, (2, 2)).tolist()
        [[[[7, 5]]]]
    """
    if not isinstance(other, Tensor):
        raise InputError(
            "other", "must be a torch.Tensor", f"it is a {type(other).__name__}",
            "convert arrays with torch.from_numpy",
        )  # fmt: skip
    if other.dtype in _SAME_WIDTH:
        # torch cannot gather these; moving their bits about is all that is asked.
        return transfer(source, other.view(_SAME_WIDTH[other.dtype]), exemplar_shape).view(other.dtype)
    maps = other if other.ndim == 4 else other.unsqueeze(0)
    if maps.ndim != 4 or tuple(maps.shape[-2:]) != exemplar_shape:
        raise InputError(
            "other", f"must be a map of the exemplar's size {exemplar_shape}",
            f"its shape is {tuple(other.shape)}", "resample it to the exemplar first",
        )  # fmt: skip
    if len(maps) not in (1, len(source)):
        raise InputError(
            "other", f"must be one map, or {len(source)}: one for each output",
            f"there are {len(maps)}", "pass them one for each output",
        )  # fmt: skip
    if bool((source < 0).any()):
        raise InputError(
            "transfer", "needs a source for every pixel", "some were given, and come from no exemplar pixel",
            "fill the picture from itself, not from another exemplar",
        )  # fmt: skip
    height, width = source.shape[-2:]
    sites = (source[:, 0] * exemplar_shape[1] + source[:, 1]).flatten(1)
    flat = maps.flatten(2).expand(len(source), -1, -1)
    picked = flat.gather(2, sites.unsqueeze(1).expand(-1, maps.shape[1], -1))
    return picked.view(len(source), maps.shape[1], height, width)
