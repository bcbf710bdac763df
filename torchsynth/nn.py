"""Synthesis as modules, for torch pipelines: in ``nn.Sequential``, in lists of transforms, in kornia's.

The tensors a module is made with are buffers: they move with ``.to`` and are kept by ``state_dict``. Pictures
are ``(C, H, W)`` or ``(B, C, H, W)``, and come back as they came.

Seeds: with ``seed=None`` a module draws new ones at each call, from torch's global generator as other transforms
do, so ``torch.manual_seed`` governs them. With a number, each call gives the same: picture ``i`` of a batch has the
seed ``seed + i``.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from torchsynth import checks
from torchsynth.analogy import analogy, plan_analogy
from torchsynth.codebook import Codebook
from torchsynth.completion import fill
from torchsynth.errors import InputError
from torchsynth.exemplar import Exemplar
from torchsynth.recipe import Recipe
from torchsynth.recipes import wei_levoy
from torchsynth.synthesis import synthesize

_SEEDS = 2**32


class Synthesize(nn.Module):
    """Seeds in, textures out.

    Args:
        exemplar: The sample ``(C, H, W)``, or an :class:`torchsynth.Exemplar` of one.
        recipe: The algorithm; None means :func:`torchsynth.recipes.wei_levoy`.
        size: Height and width of the outputs.
        codebook: Trees that were trained for this exemplar and recipe.

    Raises:
        InputError: If the exemplar is a batch, or the codebook another one's; at the first call, if the rest
            does not fit together.

    Example:
        >>> import torchsynth as ts
        >>> make = Synthesize(torch.rand(3, 16, 16), ts.recipes.ashikhmin(), (8, 8))
        >>> make(torch.tensor([4, 5])).shape, make(4).shape
        (torch.Size([2, 3, 8, 8]), torch.Size([3, 8, 8]))
        >>> list(make.state_dict())
        ['exemplar']
    """

    exemplar: Tensor
    valid: Tensor | None

    def __init__(
        self,
        exemplar: Tensor | Exemplar,
        recipe: Recipe | None = None,
        size: tuple[int, int] = (256, 256),
        *,
        codebook: Codebook | None = None,
    ) -> None:
        super().__init__()
        sample = exemplar if isinstance(exemplar, Exemplar) else Exemplar(exemplar)
        _check_single(sample.image, "exemplar")
        self.recipe = wei_levoy() if recipe is None else recipe
        checks.check_type(self.recipe, Recipe, "recipe", "pass e.g. torchsynth.recipes.wei_levoy()")
        self.size = checks.check_size(size)
        self.register_buffer("exemplar", sample.samples[0])
        self.register_buffer("valid", sample.valid)
        self._trained = None if codebook is None else tuple(codebook.trees)
        for name, tensor in ({} if codebook is None else codebook.tensors()).items():
            self.register_buffer(_buffer(name), tensor)

    @property
    def codebook(self) -> Codebook | None:
        """The trees, as the buffers have them."""
        if self._trained is None:
            return None
        buffers = dict(self.named_buffers())
        tensors = {
            name.removeprefix(_PREFIX).replace("_", ".", 1): tensor
            for name, tensor in buffers.items()
            if name.startswith(_PREFIX)
        }
        return Codebook.of_tensors(self._trained, tensors)

    def forward(self, seed: Tensor | int | Sequence[int]) -> Tensor:
        """One texture ``(C, H, W)`` for a number, ``(B, C, H, W)`` for several.

        Args:
            seed: A number or a tensor of one; or several, in a list or a tensor ``(B,)``.
        """
        seeds = seed.tolist() if isinstance(seed, Tensor) else seed
        exemplar = Exemplar(self.exemplar, self.valid)
        made = synthesize(exemplar, self.size, self.recipe, seed=seeds, codebook=self.codebook).image
        return made if isinstance(seeds, Sequence) else made[0]


class Fill(nn.Module):
    """Pictures with holes in, whole pictures out; all else of them stays as it is.

    Args:
        recipe: See :func:`torchsynth.fill`; None means the usual one.
        hole: ``(H, W)``, True where every picture is to be filled. None takes the pixels that are NaN in any
            channel, which an earlier transform has marked so; a picture without any is returned as it is.
        seed: See :mod:`torchsynth.nn`.

    Example:
        >>> picture = torch.rand(3, 24, 24)
        >>> picture[:, 4:8, 4:8] = torch.nan
        >>> bool(Fill()(picture).isfinite().all())
        True
    """

    hole: Tensor | None

    def __init__(
        self, recipe: Recipe | None = None, *, hole: Tensor | None = None, seed: int | None = 0
    ) -> None:
        super().__init__()
        self.recipe, self.seed = recipe, seed
        self.register_buffer("hole", hole)

    def forward(self, image: Tensor) -> Tensor:
        """The pictures with their holes filled.

        Args:
            image: ``(C, H, W)`` or ``(B, C, H, W)``.

        Raises:
            InputError: If it is no picture, or the hole is not of its size.
        """
        _check_picture(image)
        if self.hole is not None:
            checks.check_region(self.hole, (image.shape[-2], image.shape[-1]), "hole")
        batch = image if image.ndim == 4 else image.unsqueeze(0)
        missing = batch.isnan()
        holes = missing.any(1) if self.hole is None else self.hole.expand(len(batch), -1, -1)
        filled = [
            fill(picture, hole, recipe=self.recipe, seed=seed).image[0] if bool(hole.any()) else picture
            for picture, hole, seed in zip(
                batch.masked_fill(missing & holes.unsqueeze(1), 0),
                holes,
                _seeds(self.seed, len(batch)),
                strict=True,
            )
        ]
        return torch.stack(filled).view(image.shape)


class Analogy(nn.Module):
    """Pictures B in, pictures B' out: what A' is to A.

    Args:
        a: As for :func:`torchsynth.analogy`.
        a_prime: Likewise.
        recipe: Likewise.
        labels: Likewise.
        seed: See :mod:`torchsynth.nn`.

    Raises:
        InputError: If A and A' do not fit together.

    Example:
        >>> a = torch.rand(1, 20, 20)
        >>> Analogy(a, 1 - a)(torch.rand(2, 1, 8, 9)).shape
        torch.Size([2, 1, 8, 9])
    """

    a: Tensor
    a_prime: Tensor

    def __init__(
        self,
        a: Tensor,
        a_prime: Tensor,
        recipe: Recipe | None = None,
        *,
        labels: bool = False,
        seed: int | None = 0,
    ) -> None:
        super().__init__()
        _check_single(a_prime, "A'")
        plan_analogy(a, a_prime, a, recipe, labels=labels)
        self.recipe, self.labels, self.seed = recipe, labels, seed
        self.register_buffer("a", a)
        self.register_buffer("a_prime", a_prime)

    def forward(self, b: Tensor) -> Tensor:
        """The pictures that are to ``b`` as A' is to A.

        Args:
            b: ``(G, H, W)`` or ``(B, G, H, W)``, like A; maps of whole numbers may be ``(H, W)``.
        """
        pictures = list(b) if b.ndim == 4 else [b]
        made = [
            analogy(self.a, self.a_prime, one, self.recipe, labels=self.labels, seed=seed).image[0]
            for one, seed in zip(pictures, _seeds(self.seed, len(pictures)), strict=True)
        ]
        return torch.stack(made) if b.ndim == 4 else made[0]


class Retexture(nn.Module):
    """Replace a region of pictures, or their background, by texture of an exemplar: an augmentation.

    Args:
        exemplar: The sample ``(C, H, W)``.
        recipe: The algorithm; None means :func:`torchsynth.recipes.wei_levoy`.
        region: ``(H, W)``, True where pictures are replaced, unless a call says so itself.
        p: How likely a picture is changed at all.
        seed: See :mod:`torchsynth.nn`.

    Raises:
        InputError: If ``p`` is no probability.

    Example:
        >>> from torchsynth.recipes import ashikhmin
        >>> background = torch.arange(12).expand(12, 12) < 6
        >>> change = Retexture(torch.rand(3, 16, 16), ashikhmin(), region=background)
        >>> picture = torch.rand(3, 12, 12)
        >>> change(picture)[:, :, 6:].equal(picture[:, :, 6:])
        True
    """

    exemplar: Tensor
    region: Tensor | None

    def __init__(
        self,
        exemplar: Tensor,
        recipe: Recipe | None = None,
        *,
        region: Tensor | None = None,
        p: float = 1.0,
        seed: int | None = None,
    ) -> None:
        super().__init__()
        checks.check_image(exemplar, "exemplar")
        _check_single(exemplar, "exemplar")
        if not 0 <= p <= 1:
            raise InputError("p", "must lie from 0 to 1", f"it is {p}", "choose a probability")
        self.recipe = wei_levoy() if recipe is None else recipe
        self.p, self.seed = p, seed
        self.register_buffer("exemplar", exemplar)
        self.register_buffer("region", region)

    def forward(self, image: Tensor, region: Tensor | None = None) -> Tensor:
        """The pictures, with texture in the region; of each batch, some stay as they are if ``p`` is below 1.

        Args:
            image: ``(C, H, W)`` or ``(B, C, H, W)``.
            region: ``(H, W)`` or one for each, ``(B, H, W)``; None takes the module's own.

        Raises:
            InputError: If it is no picture of the exemplar's channels, or the region does not fit it.
        """
        _check_picture(image)
        where = self.region if region is None else region
        if where is None:
            raise InputError(
                "region", "must be given to the module or its call", "there is none", "pass a boolean (H, W)"
            )
        batch = image if image.ndim == 4 else image.unsqueeze(0)
        self._check_fits(batch, where)
        height, width = batch.shape[-2:]
        for one in where if where.ndim == 3 else where.unsqueeze(0):
            checks.check_region(one, (height, width), "region")
        seeds = _seeds(self.seed, len(batch))
        chances = torch.stack([torch.rand((), generator=torch.Generator().manual_seed(one)) for one in seeds])
        chosen = (chances < self.p).nonzero().flatten().tolist()
        result = batch.clone()
        if chosen:
            some = [seeds[one] for one in chosen]
            texture = synthesize(self.exemplar, (height, width), self.recipe, seed=some).image.to(batch)
            inside = where.expand(len(batch), -1, -1)[chosen].unsqueeze(1)
            result[chosen] = torch.where(inside, texture, batch[chosen])
        return result.view(image.shape)

    def _check_fits(self, batch: Tensor, where: Tensor) -> None:
        channels = self.exemplar.shape[-3]
        if batch.shape[1] != channels:
            raise InputError(
                "image", f"must have the exemplar's {channels} channel(s)", f"it has {batch.shape[1]}",
                "convert one of them",
            )  # fmt: skip
        if where.ndim == 3 and len(where) not in (1, len(batch)):
            raise InputError(
                "region", f"must be one, or one for each of {len(batch)} pictures", f"there are {len(where)}",
                "pass them one for each picture",
            )  # fmt: skip


_PREFIX = "codebook_"


def _buffer(name: str) -> str:
    """The buffer for a tensor of a codebook: names of buffers have no dots."""
    return _PREFIX + name.replace(".", "_", 1)


def _check_picture(image: Tensor) -> None:
    """Kind and shape only: transforms may have moved the values out of [0, 1], or marked a hole with NaN."""
    plain = image.float() if image.is_floating_point() else image
    checks.check_image(torch.zeros_like(plain), "image")


def _check_single(image: Tensor, subject: str) -> None:
    if image.ndim == 4 and len(image) > 1:
        raise InputError(
            subject, "must be one picture (C, H, W)", f"there are {len(image)}", "make a module for each"
        )


def _seeds(seed: int | None, outputs: int) -> list[int]:
    """A seed for each of so many pictures."""
    if seed is None:
        drawn: list[int] = torch.randint(_SEEDS, (outputs,)).tolist()
        return drawn
    return checks.check_seeds(seed, outputs)
