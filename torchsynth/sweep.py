"""A sweep: what is compared, how it is searched, in which order, and what is taken.

:mod:`torchsynth.visits` runs it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeAlias

from jaxtyping import Float
from pydantic import Field, model_validator
from torch import Tensor

from torchsynth._typing import Sites
from torchsynth.accept import Accept, Best
from torchsynth.canvas import Canvas
from torchsynth.index import Index
from torchsynth.neighborhood import Layer, Planes, layer_weights, layers_at
from torchsynth.part import Part
from torchsynth.reader import plane_of
from torchsynth.schedule import OnionPeel, Order, Rows, Scanline
from torchsynth.search import TSVQ, Exhaustive, PreferCoherent, Search, Tree

Levels: TypeAlias = Annotated[tuple[Annotated[int, Field(ge=0)], ...], Field(min_length=1, strict=False)]


class Sweep(Part):
    """One pass over a level: what is compared, how it is searched, in which order, what is taken.

    Args:
        layers: The neighborhood.
        search: How candidates are found.
        order: Which pixel comes first.
        accept: Which candidate wins.
        levels: The pyramid levels this sweep runs on, 0 the finest; or ``coarsest``, or ``finer`` for all
            others, however many there are; None means all of them.
        rows: The rows to visit, as in a Python slice: ``(0, -2)`` leaves out the last two, ``(-2, None)``
            visits only them; ``(-2, 2)`` goes around the torus, from the last two to the first two. None
            means all.
        unknown: What becomes of neighbors that show only what the level started from: ``read`` compares
            them and takes their offers, ``skip`` leaves them out until they have been synthesized.
        normalize: Share each layer's weight out among its neighbors, so that equal weights count the
            same whatever the template sizes. The papers sum plain squared differences.

    Example:
        >>> from torchsynth.template import Causal
        >>> sweep = Sweep(layers=(Layer(plane="result", template=Causal(size=9)),))
        >>> sweep.order.kind, sweep.search.kind, sweep.accept.kind
        ('scanline', 'exhaustive', 'best')
    """

    layers: Annotated[tuple[Layer, ...], Field(min_length=1, strict=False)]
    search: Search = Exhaustive()
    order: Order = Scanline()
    accept: Accept = Best()
    levels: Levels | Literal["coarsest", "finer"] | None = None
    rows: Annotated[Rows, Field(strict=False)] | None = None
    unknown: Literal["read", "skip"] = "read"
    normalize: bool = False

    @model_validator(mode="after")
    def _refused_pixels_come_again(self) -> Sweep:
        if self.accept.refuses and not isinstance(self.order, OnionPeel):
            raise ValueError(
                "an acceptance with 'max_error' may refuse a pixel, and only the order 'onion_peel' comes back "
                f"to it, but the order is {self.order.kind!r}; set max_error to null"
            )
        return self

    def runs_at(self, level: int, levels: int) -> bool:
        """Whether the sweep visits this level of so many."""
        if isinstance(self.levels, str):
            return (level == levels - 1) == (self.levels == "coarsest")
        return self.levels is None or level in self.levels


@dataclass(frozen=True)
class Fitted:
    """A sweep with what its searcher has made of one level's candidates.

    Args:
        sweep: The sweep.
        layers: Those of its layers that exist at this level.
        sites: The flat exemplar position of each candidate.
        weights: How much each feature's squared difference counts.
        state: The searcher's own affair.
    """

    sweep: Sweep
    layers: tuple[Layer, ...]
    sites: Sites
    weights: Float[Tensor, " features"]
    state: Any

    @classmethod
    def to(
        cls,
        sweep: Sweep,
        level: int,
        canvases: Sequence[Canvas],
        exemplar: Planes,
        tree: Tree | None = None,
    ) -> Fitted:
        """Fit a sweep's searcher to the exemplar's planes, at one level of so many canvases.

        A tree that was trained for just this is used in place of training one.
        """
        layers = layers_at(sweep.layers, level, len(canvases))
        index = Index.of(layers, layer_weights(layers, sweep.normalize), exemplar, level)
        complete = sweep.unknown == "read" and all(
            plane.boundary == "torus" and plane.valid is None
            for plane in (plane_of(layer, level, canvases) for layer in layers)
        )
        state: Any
        if tree is not None and isinstance(sweep.search, TSVQ | PreferCoherent):
            state = sweep.search.prepare(index, tree)
        else:
            state = sweep.search.fit(index, complete)
        return cls(sweep, layers, index.sites, index.weights.to(index.dtype), state)

    def serves(self, sweep: Sweep) -> bool:
        """Whether another sweep of the same level can use what was fitted for this one."""
        same = ("layers", "search", "unknown", "normalize")
        return all(getattr(self.sweep, name) == getattr(sweep, name) for name in same)
