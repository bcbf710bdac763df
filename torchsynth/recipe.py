"""A recipe: everything that makes an algorithm, as one value."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import Field, model_serializer, model_validator

from torchsynth._typing import Image, Region
from torchsynth.initial import Initial, Noise
from torchsynth.lattice import Boundary
from torchsynth.morphology import Operation, chosen, widened
from torchsynth.neighborhood import layers_at
from torchsynth.part import Part
from torchsynth.patches import Patches
from torchsynth.schedule import Simultaneous, goes_around
from torchsynth.sweep import Sweep
from torchsynth.template import Side


class Structure(Part):
    """A guide of the recipe's own making: the exemplar with wide edges, and a texture made of that.

    Thin edges, such as the joints between stones, are few among the pixels that are compared. Widened by a
    morphological operation they count for more, and objects stay whole. So first the widened exemplar is
    synthesized; then that texture guides the synthesis from the exemplar itself, as an analogy: what the
    exemplar is to the widened one, the output is to the texture.

    Args:
        operation: ``erode`` widens dark edges, ``dilate`` bright ones; ``auto`` takes the one that widens the
            thinner of the exemplar's dark and bright parts; see :func:`torchsynth.morphology.chosen`.
        size: Side of the square by which edges are widened, odd, or ``auto``: the smallest with which
            they come to a quarter of the histogram; see :func:`torchsynth.morphology.chosen`.
        recipe: How the texture is made of the widened exemplar.

    Source:
        The improved Wei-Levoy algorithm, section 4.1.
    """

    operation: Literal[Operation, "auto"] = "auto"
    size: Side | Literal["auto"] = "auto"
    recipe: Recipe

    def settled(self, image: Image, valid: Region | None = None) -> Structure:
        """The same with operation and size as they are chosen for one picture.

        Args:
            image: The exemplar.
            valid: Where it may be sampled.
        """
        operation = None if self.operation == "auto" else self.operation
        size = None if self.size == "auto" else self.size
        operation, size, _ = chosen(image, operation, size, valid)
        return self.model_copy(update={"operation": operation, "size": size})

    def widen(self, image: Image, valid: Region | None = None) -> Image:
        """Pictures with their edges widened; operation and size have to be settled."""
        assert self.operation != "auto" and self.size != "auto", "settled before"  # noqa: S101, PT018 (for the type checker)
        return widened(image, self.operation, self.size, valid)


class Recipe(Part):
    """How to synthesize: the pyramid, what it starts from, and the sweeps over each level.

    Args:
        name: What it is called, for messages and file names.
        description: One line about it.
        levels: How many pyramid levels; 1 is single resolution. Visible effect: each further level
            doubles the size of the structures that the same neighborhood can hold together.
        boundary: ``torus`` outputs tile; ``open`` ones have borders like the exemplar's.
        initial: What each level shows before its first sweep.
        sweeps: The passes over each level, in order.
        patches: How whole patches are copied, in place of sweeps over pixels; on one level, and without an
            ``initial`` picture.
        blur_seams: Blur the finished picture along the boundaries of its patches, with a binomial kernel
            of so many pixels. Its pixels there are then no copies. Source: Ashikhmin 2001, section 5.
        dynamic_range: ``finest`` stretches the values of every level to the range of the finest one: blurred
            levels have a smaller range, and so count for less. Visible effect: structures of the coarse
            levels are kept more strictly. Source: the improved Wei-Levoy algorithm, section 4.3.
        structure: If given, the guides that the sweeps compare are not the user's but made by this.
        channels: ``joint`` compares and copies all channels of a pixel together; ``separate`` synthesizes
            each by itself, as if it were a gray picture, so that an output pixel may show colors that the
            exemplar has nowhere, and has no source. Source: the GrowImage notes on Efros & Leung 1999.

    Example:
        >>> from torchsynth import recipes
        >>> recipes.wei_levoy(levels=2).levels
        2
    """

    name: Annotated[str, Field(min_length=1)] = "custom"
    description: str = ""
    levels: Annotated[int, Field(ge=1, le=16)]
    boundary: Boundary = "torus"
    initial: Initial = Noise()
    sweeps: Annotated[tuple[Sweep, ...], Field(strict=False)] = ()
    patches: Patches | None = None
    blur_seams: Annotated[Side, Field(ge=3, le=15)] | None = None
    dynamic_range: Literal["own", "finest"] = "own"
    structure: Structure | None = None
    channels: Literal["joint", "separate"] = "joint"

    @model_validator(mode="after")
    def _sweeps_or_patches(self) -> Recipe:
        if self.patches is None:
            if not self.sweeps:
                raise ValueError("a recipe has sweeps or patches, but this one has neither")
            return self
        if self.sweeps:
            raise ValueError("a recipe has sweeps or patches, but this one has both")
        if self.levels > 1:
            raise ValueError(f"patches are copied on one level, but there are {self.levels}")
        if self.initial != Noise():
            raise ValueError("patches cover whatever an output starts from, but there is an 'initial'")
        return self

    @model_validator(mode="after")
    def _every_level_is_swept(self) -> Recipe:
        if self.patches is not None:
            return self
        for sweep in self.sweeps:
            named = () if isinstance(sweep.levels, str) else sweep.levels or ()
            beyond = [level for level in named if level >= self.levels]
            if beyond:
                raise ValueError(
                    f"a sweep names level {beyond[0]}, but with {self.levels} levels the coarsest is "
                    f"{self.levels - 1}"
                )
            self._check_layers(sweep)
            self._check_sight(sweep)
            if goes_around(sweep.rows) and self.boundary != "torus":
                raise ValueError(f"rows {list(sweep.rows or ())} go around a torus, but the boundary is open")
        missing = set(range(self.levels)) - {
            level for sweep in self.sweeps for level in self.levels_of(sweep)
        }
        if missing:
            raise ValueError(f"no sweep runs on level {min(missing)}, so it would stay noise")
        return self

    def _check_layers(self, sweep: Sweep) -> None:
        visited = self.levels_of(sweep)
        for level in visited:
            if not layers_at(sweep.layers, level, self.levels):
                raise ValueError(
                    f"a sweep compares something at each of its levels, but at level {level} all its "
                    f"layers read above the coarsest level, {self.levels - 1}; it needs a result layer"
                )
        for layer in sweep.layers:
            # The usual parent layer may be left out of a single level; one that was pointed at may not.
            if layer.up is not None and visited and min(visited) + layer.up >= self.levels:
                raise ValueError(
                    f"a layer reads a level that exists, but one with up={layer.up} reads above "
                    f"the coarsest level, {self.levels - 1}, wherever its sweep runs"
                )

    def _check_sight(self, sweep: Sweep) -> None:
        """The first sweep of a level that nothing is known of cannot skip all it does not know."""
        blind = sweep.unknown == "skip" and isinstance(sweep.order, Simultaneous)
        for level in self.levels_of(sweep) if blind else ():
            inherits = self.initial.inherits and level < self.levels - 1
            planes = {layer.plane for layer in layers_at(sweep.layers, level, self.levels)}
            if planes == {"result"} and not inherits and self.sweeps_at(level)[0] is sweep:
                raise ValueError(
                    f"a level's first sweep sees something, but at level {level} it visits all pixels at "
                    "once and skips those that are unknown: all of them; let it read them, or use another order"
                )

    @model_validator(mode="after")
    def _sources_are_there(self) -> Recipe:
        if all(sweep.search.has_sources for sweep in self.sweeps):
            if self.blur_seams is not None and self.channels == "separate":
                raise ValueError("seams are those of all channels together, but they are separate")
            return self
        if self.blur_seams is not None:
            raise ValueError("seams lie between copied patches, but a sweep's leaves propose centroids")
        if self.initial.inherits and self.levels > 1:
            raise ValueError(
                "levels inherit sources, but a sweep's leaves propose centroids, which have none"
            )
        return self

    @model_validator(mode="after")
    def _structure_is_of_use(self) -> Recipe:
        if self.structure is None:
            return self
        if not self.follows_guide:
            raise ValueError("a structure is made to be compared, but no sweep has a layer on a guide plane")
        inner = self.structure.recipe
        if inner.structure is not None or inner.follows_guide or inner.follows_target:
            raise ValueError("a structure is made without guide or target, but its own recipe compares one")
        if inner.boundary != self.boundary:
            raise ValueError(
                f"a structure must have the recipe's boundary, but they are {inner.boundary} and {self.boundary}"
            )
        return self

    @model_serializer(mode="wrap")
    def _only_what_counts(self, serialize: Callable[[Recipe], dict[str, Any]]) -> dict[str, Any]:
        fields = serialize(self)
        if self.patches is not None:
            return {name: value for name, value in fields.items() if name not in ("initial", "sweeps")}
        return fields

    def changed(self, **fields: object) -> Recipe:
        """The recipe with other values of some fields, checked like any other.

        A structure gets the boundary of the recipe.

        Raises:
            pydantic.ValidationError: If the values do not fit.

        Example:
            >>> from torchsynth import recipes
            >>> recipes.ashikhmin().changed(blur_seams=3).blur_seams
            3
        """
        if self.structure is not None and "boundary" in fields:
            inner = self.structure.recipe.changed(boundary=fields["boundary"])
            fields = {"structure": self.structure.model_copy(update={"recipe": inner})} | fields
        return Recipe.model_validate(dict(self) | fields)

    @property
    def has_sources(self) -> bool:
        """Whether every pixel of the output is a copy of an exemplar pixel."""
        return self.channels == "joint" and all(sweep.search.has_sources for sweep in self.sweeps)

    @property
    def refuses(self) -> bool:
        """Whether any sweep may refuse a pixel at first."""
        return any(sweep.accept.refuses for sweep in self.sweeps)

    @property
    def follows_target(self) -> bool:
        """Whether any sweep compares a target, or patches do."""
        if self.patches is not None:
            return self.patches.follows_target
        return any(layer.plane == "target" for sweep in self.sweeps for layer in sweep.layers)

    @property
    def follows_guide(self) -> bool:
        """Whether any sweep compares guides."""
        return any(layer.is_guide for sweep in self.sweeps for layer in sweep.layers)

    def levels_of(self, sweep: Sweep) -> tuple[int, ...]:
        """The levels a sweep runs on, the finest first."""
        return tuple(level for level in range(self.levels) if sweep.runs_at(level, self.levels))

    def sweeps_at(self, level: int) -> tuple[Sweep, ...]:
        """The sweeps of a level, in order."""
        return tuple(sweep for sweep in self.sweeps if sweep.runs_at(level, self.levels))


Structure.model_rebuild()
