"""The base of every part: a small, frozen, validated value that is also its own configuration."""

from __future__ import annotations

from typing import Any

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

    def plain(self) -> dict[str, Any]:
        """As plain data, for YAML and JSON; a field that is None, as it is by default, is left out.

        Example:
            >>> from torchsynth.accept import WithinTolerance
            >>> WithinTolerance(max_error=None).plain()["max_error"] is None
            True
            >>> from torchsynth.search import TSVQ
            >>> "depth" in TSVQ().plain()
            False
        """
        plain: dict[str, Any] = _plain(self, self.model_dump(mode="json"))
        return plain


def _plain(value: object, dumped: Any) -> Any:  # noqa: ANN401 (any value of any field)
    """What pydantic made of a value, without what says no more than the default."""
    if isinstance(value, Part):
        fields = type(value).model_fields
        said = [name for name in dumped if dumped[name] is not None or fields[name].default is not None]
        return {name: _plain(getattr(value, name), dumped[name]) for name in said}
    if isinstance(value, tuple):
        return [_plain(*both) for both in zip(value, dumped, strict=True)]
    return dumped
