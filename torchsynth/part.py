"""The base of every part: a small, frozen, validated value that is also its own configuration."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Part(BaseModel):
    """A value that describes one choice of an algorithm, and can be written to YAML as it stands.

    Parts never change after they are made and hold nothing that is computed from an image. An
    unknown field is an error, and so is a value of another type: nothing is converted silently.

    Example:
        >>> from torchsynth import template
        >>> template.Causal(size=9).model_dump()
        {'kind': 'causal', 'size': 9}
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)
