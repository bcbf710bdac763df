"""The files of an output: the picture, the source map, the recipe, and the record."""

from __future__ import annotations

import json
from pathlib import Path

from torchsynth.config import dump_recipe
from torchsynth.errors import InputError
from torchsynth.io import encode_image
from torchsynth.records import Job, record_of
from torchsynth.result import check_sources
from torchsynth.source_map import encode_source_map
from torchsynth.studio.visitor import Made


def write_files(made: Made, folder: Path) -> dict[str, str]:
    """Write what can be downloaded.

    Args:
        made: The output.
        folder: Where to, an empty one.

    Returns:
        The files by what they are: ``image``, ``recipe``; ``source_map`` if the output consists of copies;
        ``record`` if it can be made again from the sample alone.
    """
    recipe = made.result.recipe
    stem = folder / f"{Path(made.sample.name.rpartition(':')[2]).stem}-{recipe.name.replace(' ', '-')}"
    files = {"image": stem.with_suffix(".png"), "recipe": stem.with_suffix(".yaml")}
    files["image"].write_bytes(picture_bytes(made))
    files["recipe"].write_text(dump_recipe(recipe), encoding="utf-8")
    if _is_copied(made):
        files["source_map"] = stem.with_suffix(".npz")
        height, width = made.result.levels[0].exemplar.shape[-2:]
        files["source_map"].write_bytes(encode_source_map(made.result.source, (height, width)))
    if not made.painted:
        files["record"] = stem.with_suffix(".json")
        files["record"].write_text(json.dumps(_record(made), indent=2), encoding="utf-8")
    return {kind: str(path) for kind, path in files.items()}


def picture_bytes(made: Made) -> bytes:
    """The output as a PNG file in the sample's depth, as the command line writes it."""
    recipe, depth = made.result.recipe, made.sample.picture.depth
    copied = recipe.has_sources and recipe.blur_seams is None
    # Means of black and white are gray.
    return encode_image(
        made.result.image[0], Path("result.png"), "8-bit" if depth == "1-bit" and not copied else depth
    )


def _is_copied(made: Made) -> bool:
    try:
        check_sources(made.result.recipe, "source map")
    except InputError:
        return False
    return True


def _record(made: Made) -> dict[str, object]:
    result = made.result
    height, width = result.image.shape[-2:]
    job = Job(
        exemplar=made.sample.name,
        recipe=result.recipe,
        size=(height, width),
        seeds=result.seeds,
        angle=made.words.get("angle"),
        scale=made.words.get("scale"),
    )
    digests = {"exemplar": made.sample.picture.sha256}
    return record_of(job, result.recipe, digests, (height, width), result.seeds[0])
