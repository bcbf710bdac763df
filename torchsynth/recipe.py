"""A recipe: everything that makes an algorithm, as one value."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from torchsynth.initial import Initial, Noise
from torchsynth.lattice import Boundary
from torchsynth.part import Part
from torchsynth.sweep import Sweep


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
    sweeps: Annotated[tuple[Sweep, ...], Field(min_length=1, strict=False)]

    @model_validator(mode="after")
    def _every_level_is_swept(self) -> Recipe:
        for sweep in self.sweeps:
            beyond = [level for level in sweep.levels or () if level >= self.levels]
            if beyond:
                raise ValueError(
                    f"a sweep names level {beyond[0]}, but with {self.levels} levels the coarsest is "
                    f"{self.levels - 1}"
                )
            if self.levels - 1 in self.levels_of(sweep) and not any(
                layer.steps_up == 0 for layer in sweep.layers
            ):
                raise ValueError("the coarsest level has nothing above it, so its sweeps need a result layer")
        missing = set(range(self.levels)) - {
            level for sweep in self.sweeps for level in self.levels_of(sweep)
        }
        if missing:
            raise ValueError(f"no sweep runs on level {min(missing)}, so it would stay noise")
        return self

    def levels_of(self, sweep: Sweep) -> tuple[int, ...]:
        """The levels a sweep runs on, the finest first."""
        return tuple(level for level in range(self.levels) if sweep.runs_at(level))

    def sweeps_at(self, level: int) -> tuple[Sweep, ...]:
        """The sweeps of a level, in order."""
        return tuple(sweep for sweep in self.sweeps if sweep.runs_at(level))
