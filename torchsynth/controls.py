"""What the user pins down of the output."""

from __future__ import annotations

from dataclasses import dataclass, replace

from torch import Tensor

from torchsynth import checks
from torchsynth.errors import InputError
from torchsynth.resuming import check_initial_source


@dataclass(frozen=True)
class Controls:
    """Wishes about one particular output, beside the recipe.

    Args:
        initial: The picture that synthesis starts from in place of noise, ``(C, OH, OW)`` for all
            outputs or ``(B, C, OH, OW)``, in [0, 1]. Only what a neighborhood reads before it is
            overwritten matters: for a causal scanline the last rows and columns, at every level. With
            ``hole``, the picture that is to be completed.
        initial_source: The source map that synthesis starts from in place of noise, ``(2, OH, OW)`` for all
            outputs or ``(B, 2, OH, OW)``: that of an earlier result, which counts as synthesized. Coarser levels
            start from the same map, halved. See :func:`torchsynth.refine`.
        hole: ``(OH, OW)``, True where ``initial`` is to be synthesized; everywhere else the output is, and
            stays, as it is there. What ``initial`` shows in the hole makes no difference.
        exemplar_at: Row and column of the output at which the exemplar's first pixel lies, if what is
            known around the hole is the exemplar itself, or a part of it: ``(0, 0)`` when a picture is
            filled from itself. Those pixels then have sources, and patches that begin there can be
            continued into the hole.
        target: The picture that the output should follow, of the same shape and range. The recipe
            needs a layer that compares it: see :func:`torchsynth.recipes.with_target`.
        guide: The picture that lies upon the output, as ``Exemplar.guide`` lies upon the exemplar: of as
            many channels, and of the output's height and width. Where it looks like a part of that, the
            output will look like the exemplar there.
        target_region: ``(OH, OW)``, True where the target was painted; elsewhere the output is free.
            None means everywhere.
        angle: Degrees by which the texture is turned counter-clockwise: a number, or ``(OH, OW)`` for
            each pixel its own; see :mod:`torchsynth.field`.
        scale: Factor by which its structures are enlarged: a number, or ``(OH, OW)``; from 1/16 to 16.
            Visible effect: above about 1.5 outputs become grainy, since pixels are copied and never made
            larger. The largest scale anywhere decides how far neighborhoods reach, and so the time.

    Raises:
        InputError: If a picture has another rank, dtype or range; if the source map has another rank or dtype, or
            comes with a picture to start from; if the hole is not boolean, nowhere or
            everywhere True, of another size than the picture, or without one; if ``exemplar_at`` is no pair
            of whole numbers, or comes without a hole; if the region is not boolean or
            nowhere True, or comes without a target; if an angle is not finite, or a scale not from
            1/16 to 16.

    Example:
        >>> import torch
        >>> Controls(initial=torch.zeros(1, 8, 8)).initial.shape
        torch.Size([1, 8, 8])
    """

    initial: Tensor | None = None
    initial_source: Tensor | None = None
    hole: Tensor | None = None
    exemplar_at: tuple[int, int] | None = None
    target: Tensor | None = None
    target_region: Tensor | None = None
    guide: Tensor | None = None
    angle: Tensor | float | None = None
    scale: Tensor | float | None = None

    def __post_init__(self) -> None:
        if self.initial is not None:
            checks.check_image(self.initial, "initial")
        check_initial_source(self.initial_source, self.initial)
        if self.target is not None:
            checks.check_image(self.target, "target")
        if self.guide is not None:
            checks.check_image(self.guide, "guide")
        checks.check_hole(self.hole, self.initial)
        if self.exemplar_at is not None and self.hole is None:
            raise InputError(
                "exemplar_at",
                "says where the exemplar lies around a hole",
                "there is no hole",
                "pass the hole, too",
            )
        if self.exemplar_at is not None:
            checks.check_place(self.exemplar_at, "exemplar_at")
        checks.check_target_region(self.target_region, self.target)
        checks.check_field(self.angle, "angle", None)
        checks.check_field(self.scale, "scale", (1 / 16, 16.0))

    @property
    def distorts(self) -> bool:
        """Whether neighborhoods are turned or scaled."""
        return self.angle is not None or self.scale is not None

    def split(self, outputs: int) -> list[Controls]:
        """The same for each of so many outputs by itself.

        Example:
            >>> import torch
            >>> [one.initial.shape[0] for one in Controls(initial=torch.zeros(2, 1, 8, 8)).split(2)]
            [1, 1]
        """
        pictures = [
            {
                name: picture[number : number + 1]
                for name in ("initial", "initial_source", "target", "guide")
                if (picture := getattr(self, name)) is not None and picture.ndim == 4 and len(picture) > 1
            }
            for number in range(outputs)
        ]
        return [replace(self, **some) for some in pictures]

    def channel(self, number: int) -> Controls:
        """The same for one channel of the output."""
        pictures = {
            name: picture[..., number : number + 1, :, :]
            for name in ("initial", "target")
            if (picture := getattr(self, name)) is not None
        }
        return replace(self, **pictures)
