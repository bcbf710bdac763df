"""The file that says which outputs are wanted: a grid of lists."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from torchsynth.checks import shortened
from torchsynth.errors import ConfigError
from torchsynth.viz import KINDS
from torchsynth.wishes import parse_size
from torchsynth.yaml_text import YAML_SUFFIXES, config_error, read_yaml, suggestion

MOST = 100_000
"""The most outputs of one grid."""

_RANGE = re.compile(r"\s*(\d{1,19})\s*\.\.\s*(\d{1,19})\s*")


def _seeds(value: object) -> object:
    """``start..stop`` as the seeds from start to stop, both among them."""
    if not isinstance(value, str):
        return _several(value)
    match = _RANGE.fullmatch(value)
    if match is None:
        raise ValueError(f"seeds are a list, or a range such as 3..5, but it is {shortened(value)}")
    start, stop = int(match[1]), int(match[2])
    if not 0 <= stop - start < MOST:
        raise ValueError(
            f"seeds go from start up to stop, at most {MOST} of them, but it is {shortened(value)}"
        )
    return range(start, stop + 1)


def _several(value: object) -> object:
    """One value as a list of one, so that ``exemplars: sample:brick`` means what it says."""
    return (value,) if isinstance(value, str | int) and not isinstance(value, bool) else value


def _size(value: object) -> object:
    if isinstance(value, list | tuple):
        return value
    if not isinstance(value, str):
        raise ValueError(f"a size is written HxW, but it is {shortened(value)}")
    return parse_size(value)


def _kind(value: str) -> str:
    if value not in KINDS:
        raise ValueError(
            f"a figure is one of {', '.join(KINDS)}, but it is {shortened(value)}: {suggestion(value, KINDS)}"
        )
    return value


Side: TypeAlias = Annotated[int, Field(ge=1, strict=True)]
Size: TypeAlias = Annotated[tuple[Side, Side], BeforeValidator(_size)]
Text: TypeAlias = Annotated[str, Field(min_length=1)]
Seed: TypeAlias = Annotated[int, Field(ge=0, lt=2**32, strict=True)]


class Grid(BaseModel):
    """Every exemplar with every recipe, in every size, with every seed.

    Args:
        exemplars: Picture files, or ``sample:NAME``.
        recipes: Names, or YAML files.
        sizes: Height and width of the outputs, ``HxW`` or ``[H, W]``; None means twice the exemplar's.
        seeds: A list, or ``start..stop``, both among them.
        format: Of the pictures.
        source_maps: Whether the source map of each is written beside it, as ``.npz``.
        figures: What is drawn of each, of :data:`torchsynth.viz.kinds.KINDS`.

    Example:
        >>> grid = Grid(exemplars=["sample:brick"], sizes=["64x96"], seeds="3..5")
        >>> grid.sizes, list(grid.seeds), grid.recipes
        (((64, 96),), [3, 4, 5], ('wei_levoy',))
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    exemplars: Annotated[tuple[Text, ...], BeforeValidator(_several), Field(min_length=1)]
    recipes: Annotated[tuple[Text, ...], BeforeValidator(_several), Field(min_length=1)] = ("wei_levoy",)
    sizes: Annotated[Annotated[tuple[Size, ...], Field(min_length=1)] | None, BeforeValidator(_several)] = (
        None
    )
    seeds: Annotated[tuple[Seed, ...], BeforeValidator(_seeds), Field(min_length=1)] = (0,)
    format: Literal["png", "tif", "webp", "bmp", "jpg"] = "png"
    source_maps: bool = False
    figures: Annotated[tuple[Annotated[str, AfterValidator(_kind)], ...], BeforeValidator(_several)] = ()

    def __len__(self) -> int:
        return len(self.exemplars) * len(self.recipes) * len(self.sizes or (0,)) * len(self.seeds)


def load_grid(path: Path) -> Grid:
    """Read a grid from a YAML file.

    Exemplars and recipes are looked for as they are written, and else beside the file.

    Args:
        path: The file.

    Raises:
        ConfigError: If it cannot be read, is no grid, or asks for more than :data:`torchsynth.batch.grid.MOST` outputs.

    Example:
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = Path(folder, "jobs.yaml")
        ...     _ = path.write_text("{exemplars: [sample:brick], recipes: [ashikhmin], seeds: 0..7}")
        ...     len(load_grid(path))
        8
    """
    if os.path.isdir(path):
        raise ConfigError(str(path), "must be a file", "it is a folder", "name a file in it")
    if path.suffix.lower() not in YAML_SUFFIXES:
        raise ConfigError(
            str(path), f"must end in one of {' '.join(YAML_SUFFIXES)}", "it does not", "rename it"
        )
    data = read_yaml(path)
    if not isinstance(data, dict):
        raise ConfigError(
            str(path), "must be a mapping with lists of exemplars, recipes, sizes and seeds",
            "it is empty" if data is None else f"it is a {type(data).__name__}", "write e.g. exemplars: [sample:brick]",
        )  # fmt: skip
    try:
        grid = Grid.model_validate(data)
    except ValidationError as error:
        raise config_error(error, data, str(path), "the grid", Grid.model_json_schema) from None
    if len(grid) > MOST:
        raise ConfigError(
            str(path),
            f"must ask for at most {MOST} outputs",
            f"they are {len(grid)}",
            "split it into several",
        )
    places = {
        name: tuple(_found(one, path.parent) for one in getattr(grid, name))
        for name in ("exemplars", "recipes")
    }
    return grid.model_copy(update=places)


def _found(name: str, folder: Path) -> str:
    """A file as it was written, or beside the grid's own file if it is only there."""
    beside = folder / name
    return str(beside) if not Path(name).exists() and beside.is_file() else name
