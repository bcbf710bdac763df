"""Recipes that follow a painted target, made of recipes that do not."""

from __future__ import annotations

from pydantic import ValidationError

from torchsynth.checks import check_type
from torchsynth.errors import ConfigError
from torchsynth.neighborhood import Layer
from torchsynth.patches import Quilting
from torchsynth.recipe import Recipe
from torchsynth.search import Coherence
from torchsynth.sweep import Sweep
from torchsynth.template import Anticausal, Causal, Square

_MOST_PASSES = 20

# As in Efros & Freeman 2001, section 3.
_PASSES_OF_TRANSFER = 3


def with_target(recipe: Recipe, *, passes: int | None = None) -> Recipe:
    """A recipe that follows a painted target, made of one that does not.

    Every sweep that reads its own level also compares the target with the other half of its
    neighborhood: the part of the square that a causal template leaves out, or all of a square. Further
    passes repeat the sweeps of each level; coherent candidates then come from the full square, the
    pixel's own source among them. Sweeps over some of the rows, which mend the tiling, are left out. A
    recipe that follows a target already gets another number of passes. With exhaustive search, areas of one
    color come out flat, whatever the number of passes: it finds the exemplar's smoothest place.

    Args:
        recipe: Any recipe with a layer on the result plane, or with quilting.
        passes: From 1 to 20; None means 1, or 3 passes of quilting, which gets smaller blocks from pass to pass.

    Raises:
        ConfigError: If no sweep could follow a target, if the recipe makes a guide of its own, if there are
            fewer than 1 or more than 20 passes, or so many that blocks get smaller than 3 pixels.

    Source:
        Ashikhmin 2001, section 4; that any such recipe can do it is said in its section 6.

    Example:
        >>> from torchsynth.recipes import wei_levoy
        >>> recipe = with_target(wei_levoy(), passes=2)
        >>> len(recipe.sweeps), [layer.plane for layer in recipe.sweeps[0].layers]
        (2, ['result', 'coarse', 'target'])
    """
    check_type(recipe, Recipe, "recipe", "pass e.g. torchsynth.recipes.wei_levoy()")
    if passes is None:
        passes = 1 if recipe.patches is None else _PASSES_OF_TRANSFER
    if isinstance(passes, bool) or not isinstance(passes, int) or not 1 <= passes <= _MOST_PASSES:
        raise ConfigError(
            "passes", f"must be from 1 to {_MOST_PASSES}", f"it is {passes}", "choose a number between them"
        )
    if recipe.structure is not None:
        raise ConfigError(
            recipe.name, "must have no structure to follow a target", "it makes a guide of its own",
            "use a recipe without, e.g. improved_wl(morphology=False)",
        )  # fmt: skip
    if recipe.patches is not None:
        return _transfer(recipe, passes)
    if not any(layer.plane == "result" for sweep in recipe.sweeps for layer in sweep.layers):
        raise ConfigError(
            recipe.name, "must have a layer on the result plane", "there is none", "choose another recipe"
        )
    first = _first_pass(recipe) if recipe.follows_target else [_following(one) for one in _whole(recipe)]
    again = [_again(sweep) for sweep in first if any(layer.plane == "target" for layer in sweep.layers)]
    name = recipe.name if recipe.follows_target else f"{recipe.name} with target"
    return recipe.changed(name=name, sweeps=(*first, *(again * (passes - 1))))


def further_pass(recipe: Recipe) -> Recipe:
    """The recipe of one more pass over each level, for an output that is there already.

    Of a recipe that follows a target these are the sweeps that compare it; coherent candidates come from the
    full square.

    Args:
        recipe: The recipe of the earlier passes.

    Raises:
        ConfigError: If its outputs cannot be gone over once more: it copies whole patches, makes a guide of
            its own, or has outputs without sources.

    Source:
        Ashikhmin 2001, section 4.

    Example:
        >>> from torchsynth.recipes import ashikhmin_target
        >>> [sweep.search.template.kind for sweep in further_pass(ashikhmin_target(passes=3)).sweeps]
        ['square']
    """
    check_type(recipe, Recipe, "recipe", "pass e.g. torchsynth.recipes.ashikhmin_target()")
    facts = {
        "it copies whole patches": recipe.patches is not None,
        "it makes a guide of its own": recipe.structure is not None,
        "its pixels are no copies": not recipe.has_sources,
    }
    for fact, applies in facts.items():
        if applies:
            raise ConfigError(
                recipe.name, "must go over single pixels that are copies to go over them again", fact,
                "use another recipe for the further pass, e.g. ashikhmin_target",
            )  # fmt: skip
    first = _first_pass(recipe)
    if recipe.follows_target:
        first = [sweep for sweep in first if any(layer.plane == "target" for layer in sweep.layers)]
    return recipe.changed(sweeps=tuple(map(_again, first)))


def _transfer(recipe: Recipe, passes: int) -> Recipe:
    """Texture transfer instead of quilting."""
    if not isinstance(recipe.patches, Quilting):
        raise ConfigError(
            recipe.name, "must be able to follow a target", "graph cuts follow none",
            "use e.g. torchsynth.recipes.quilting_transfer()",
        )  # fmt: skip
    name = recipe.name if recipe.follows_target else f"{recipe.name} with target"
    try:
        patches = Quilting.model_validate(dict(recipe.patches) | {"passes": passes})
    except ValidationError as error:
        said = error.errors()[0]["msg"].removeprefix("Value error, ")
        expectation, _, fact = said.partition(", but ")
        raise ConfigError(
            "passes", f"must suit the recipe: {expectation}", fact, "ask for fewer, or larger blocks"
        ) from None
    return recipe.changed(name=name, patches=patches)


def _whole(recipe: Recipe) -> list[Sweep]:
    """The sweeps over all rows; one that leaves rows to a mending sweep takes them back."""
    main = [sweep for sweep in recipe.sweeps if not _is_mending(sweep)]
    if {level for sweep in main for level in recipe.levels_of(sweep)} != set(range(recipe.levels)):
        return list(recipe.sweeps)  # their rows are shared out in another way
    return [sweep.model_copy(update={"rows": None}) for sweep in main]


def _first_pass(recipe: Recipe) -> list[Sweep]:
    """The sweeps that are no repetition of an earlier one."""
    first: list[Sweep] = []
    for sweep in recipe.sweeps:
        if sweep not in first and sweep not in [_again(one) for one in first]:
            first.append(sweep)
    return first


def _is_mending(sweep: Sweep) -> bool:
    """Whether a sweep visits only some last or first rows, after another has visited the rest."""
    start, stop = sweep.rows or (0, None)
    return bool(start) or (stop or 0) > 0


def _following(sweep: Sweep) -> Sweep:
    """The sweep, comparing the target with what its result layers leave to be compared."""
    results = [layer for layer in sweep.layers if layer.plane == "result"]
    if not results:
        return sweep
    largest = max(results, key=lambda layer: layer.template.size)
    size = largest.template.size
    template = Anticausal(size=size) if isinstance(largest.template, Causal) else Square(size=size)
    layer = Layer(plane="target", template=template, weight=largest.weight)
    return sweep.model_copy(update={"layers": (*sweep.layers, layer)})


def _again(sweep: Sweep) -> Sweep:
    """The sweep as a further pass: coherent candidates come from the full square."""
    if not isinstance(sweep.search, Coherence):
        return sweep
    full = Square(size=sweep.search.template.size)
    return sweep.model_copy(update={"search": sweep.search.model_copy(update={"template": full})})
