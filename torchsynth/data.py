"""A dataset of textures, made as they are asked for."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from torch import Tensor
from torch.utils.data import Dataset

from torchsynth import checks
from torchsynth.errors import InputError
from torchsynth.exemplar import Exemplar
from torchsynth.io import read_image
from torchsynth.recipe import Recipe
from torchsynth.recipes import wei_levoy
from torchsynth.synthesis import synthesize


class TextureDataset(Dataset[dict[str, Any]]):
    """Exemplars x recipes x seeds, one texture for each: the same for the same index, whoever asks.

    Works under a ``DataLoader`` with any number of workers. The seed changes first, then the recipe, then the
    exemplar.

    Args:
        exemplars: By name, or in a list: pictures ``(C, H, W)``, or files such as ``sample:brick``.
        recipes: The algorithms; None means :func:`torchsynth.recipes.wei_levoy` alone.
        size: Height and width of every texture.
        seeds: Which seeds; a ``range`` takes no memory.
        transform: Applied to each texture.

    Raises:
        InputError: If there is no exemplar, recipe or seed, or if one of them cannot be used; at the first use,
            if a recipe does not fit an exemplar.

    Example:
        >>> import torchsynth as ts
        >>> import torch
        >>> pictures = {"fine": torch.rand(1, 16, 16), "rough": torch.rand(1, 20, 20)}
        >>> textures = TextureDataset(pictures, [ts.recipes.ashikhmin()], (8, 8), range(10))
        >>> len(textures), textures[13]["name"], textures[13]["seed"]
        (20, 'rough', 3)
    """

    def __init__(
        self,
        exemplars: Mapping[str, Tensor | str] | Sequence[Tensor | str],
        recipes: Sequence[Recipe] | None = None,
        size: tuple[int, int] = (64, 64),
        seeds: Sequence[int] = range(1000),
        transform: Callable[[Tensor], Any] | None = None,
    ) -> None:
        named = exemplars if isinstance(exemplars, Mapping) else {str(n): e for n, e in enumerate(exemplars)}
        self.recipes = (wei_levoy(),) if recipes is None else tuple(recipes)
        if isinstance(exemplars, str):
            raise InputError("exemplars", "must be a list", f"it is {exemplars!r}", f"pass [{exemplars!r}]")
        if not isinstance(seeds, Sequence):
            raise InputError(
                "seeds",
                "must be a list or a range",
                f"it is a {type(seeds).__name__}",
                "pass e.g. range(100)",
            )
        for subject, some in (("exemplars", named), ("recipes", self.recipes), ("seeds", seeds)):
            if not len(some):
                raise InputError(subject, "must have at least one", "there is none", "pass one")
        for recipe in self.recipes:
            checks.check_type(recipe, Recipe, "recipes", "pass e.g. [torchsynth.recipes.wei_levoy()]")
        self.exemplars = {name: _picture(one) for name, one in named.items()}
        ends = (seeds[0], seeds[-1]) if isinstance(seeds, range) else seeds
        for seed in ends:
            checks.check_seeds(seed, None)
        self.size, self.seeds, self.transform = checks.check_size(size), seeds, transform

    def __len__(self) -> int:
        return len(self.exemplars) * len(self.recipes) * len(self.seeds)

    def __getitem__(self, index: int) -> dict[str, Any]:
        """One texture, and what it was made of.

        Returns:
            ``image`` ``(C, H, W)``, or what ``transform`` makes of it; ``exemplar`` and ``recipe``, their numbers;
            ``name``, the exemplar's; and ``seed``.
        """
        index = operator.index(index)
        if not -len(self) <= index < len(self):
            raise IndexError(f"there are {len(self)} textures, but the index is {index}")
        rest, seed = divmod(index % len(self), len(self.seeds))
        exemplar, recipe = divmod(rest, len(self.recipes))
        name = list(self.exemplars)[exemplar]
        made = synthesize(self.exemplars[name], self.size, self.recipes[recipe], seed=self.seeds[seed])
        image = made.image[0] if self.transform is None else self.transform(made.image[0])
        return {
            "image": image,
            "exemplar": exemplar,
            "recipe": recipe,
            "name": name,
            "seed": self.seeds[seed],
        }


def _picture(given: Tensor | str) -> Exemplar:
    image = read_image(given) if isinstance(given, str) else given
    exemplar = Exemplar(image)
    if len(exemplar.samples) > 1:
        raise InputError(
            "exemplars", "must be single pictures (C, H, W)", f"one is a batch of {len(exemplar.samples)}",
            "list them",
        )  # fmt: skip
    return exemplar
