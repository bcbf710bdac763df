"""What several recipes are put together from."""

from __future__ import annotations

from collections.abc import Sequence

from torchsynth.errors import ConfigError
from torchsynth.neighborhood import Layer
from torchsynth.search import TSVQ, Exhaustive, Search
from torchsynth.template import Causal, Square


def per_level(name: str, sizes: int | Sequence[int], levels: int) -> tuple[int, ...]:
    """One size for each level, the coarsest first.

    Raises:
        ConfigError: If there is another number of them.

    Example:
        >>> per_level("neighborhood", 9, 3)
        (9, 9, 9)
    """
    sides = (sizes,) * levels if isinstance(sizes, int) else tuple(sizes)
    if len(sides) != levels:
        raise ConfigError(
            name, f"must be one size, or {levels}: one for each level it is used on",
            f"there are {len(sides)}", "list them from the coarsest level to the finest",
        )  # fmt: skip
    return sides


def causal_layers(neighborhood: int, parent: int | None) -> tuple[Layer, ...]:
    """What a scanline compares: the causal half of a square and, if wanted, a square one level up.

    Example:
        >>> [layer.plane for layer in causal_layers(9, 5)]
        ['result', 'coarse']
    """
    causal = Layer(plane="result", template=Causal(size=neighborhood))
    if parent is None:
        return (causal,)
    return causal, Layer(plane="coarse", template=Square(size=parent))


def search_named(name: str, **others: Search) -> Search:
    """A search by its name, with its default parameters: ``exhaustive``, ``tsvq``, or one of the others.

    Raises:
        ConfigError: If there is none of that name.

    Example:
        >>> search_named("tsvq").kind
        'tsvq'
    """
    searches: dict[str, Search] = {"exhaustive": Exhaustive(), "tsvq": TSVQ(), **others}
    if name not in searches:
        raise ConfigError(
            "search", f"must be one of {', '.join(searches)}", f"it is {name!r}", "choose one of them"
        )
    return searches[name]
