"""One more pass over a finished output: to follow a target more closely, or another one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from torch import Tensor

from torchsynth.controls import Controls
from torchsynth.errors import InputError
from torchsynth.exemplar import Exemplar
from torchsynth.following import further_pass
from torchsynth.recipe import Recipe
from torchsynth.result import Result
from torchsynth.synthesis import Progress, synthesize


def refine(
    exemplar: Tensor | Exemplar,
    output: Result | Tensor,
    recipe: Recipe | None = None,
    *,
    controls: Controls | None = None,
    seed: int | Sequence[int] = 0,
    progress: Progress | None = None,
) -> Result:
    """Go once more over a finished output.

    Every level begins with what the output was copied from, and gets one more pass. What the output is to
    follow may have changed meanwhile: a target may be painted over between two passes.

    Args:
        exemplar: The one that the output was made of.
        output: The earlier result, of any recipe that copies pixels, or its source map: ``(2, OH, OW)``,
            or ``(B, 2, OH, OW)``.
        recipe: Whose pass; None means the earlier result's. See :func:`torchsynth.recipes.further_pass`.
        controls: What is pinned down of the new output, such as its target.
        seed: As for :func:`torchsynth.synthesize`; a sequence needs one for each output. One number
            stands for ``seed, seed + 1, ...``. Visible effect: small, as only pixels without any candidate
            are drawn at random.
        progress: See :data:`torchsynth.synthesis.Progress`.

    Returns:
        The new output, of the same size. Its recipe is that of the one pass.

    Raises:
        InputError: If anything is wrong with the input, before any work.
        ConfigError: If the recipe has no further pass.

    Source:
        Ashikhmin 2001, section 4: a few more passes come closer to the target.

    Example:
        >>> import torch, torchsynth as ts
        >>> exemplar, target = torch.rand(1, 16, 16), torch.rand(1, 12, 12)
        >>> controls = ts.Controls(target=target)
        >>> once = ts.synthesize(exemplar, (12, 12), ts.recipes.ashikhmin_target(), controls=controls)
        >>> twice = ts.refine(exemplar, once, controls=controls)
        >>> bool((twice.image - target).abs().mean() < (once.image - target).abs().mean())
        True
    """
    source = output.source if isinstance(output, Result) else output
    begun = replace(controls or Controls(), initial_source=source)
    if recipe is None:
        if not isinstance(output, Result):
            raise InputError(
                "recipe", "must be given to refine a source map", "there is none", "pass the recipe, too"
            )
        recipe = output.recipe
    height, width = source.shape[-2:]
    outputs = len(source) if source.ndim == 4 else 1
    seeds = range(seed, seed + outputs) if isinstance(seed, int) else seed
    return synthesize(
        exemplar, (height, width), further_pass(recipe), controls=begun, seed=tuple(seeds), progress=progress
    )
