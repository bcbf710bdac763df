"""Recipes as YAML: what is read, what is written, and what each mistake is told."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import yaml

import torchsynth as ts
from torchsynth.config import dump_recipe, load_recipe, parse_recipe, recipe_schema
from torchsynth.recipes import RECIPES, wei_levoy

CONFIGS = Path(__file__).parents[1] / "configs"
GOOD = dump_recipe(wei_levoy())


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.stem)
def test_each_config_equals_its_function(path):
    recipe = load_recipe(path)
    assert recipe == RECIPES[path.stem]()
    assert dump_recipe(recipe) == path.read_text()


def test_each_recipe_has_its_config():
    assert {path.stem for path in CONFIGS.glob("*.yaml")} == set(RECIPES)


@pytest.mark.parametrize(
    "recipe",
    [
        wei_levoy(levels=3, neighborhood=(9, 7, 5), parent=(5, 3), boundary="open"),
        load_recipe("wei_levoy_single", ["sweeps[0].order={kind: shuffle, seed: 4294967295}",
                                         "description='colon: \"quotes\" \u00e9'"]),
    ],
    ids=["one sweep for each level", "odd texts and large numbers"],
)  # fmt: skip
def test_a_recipe_survives_the_way_to_yaml_and_back(recipe):
    text = dump_recipe(recipe)
    assert parse_recipe(yaml.safe_load(text), "x") == recipe
    assert dump_recipe(parse_recipe(yaml.safe_load(text), "x")) == text


def test_json_is_read_as_well(tmp_path):
    path = tmp_path / "recipe.json"
    path.write_text(json.dumps(wei_levoy(levels=2).model_dump(mode="json")))
    assert load_recipe(path) == wei_levoy(levels=2)


def test_anchors_and_merge_keys_work(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text(
        "levels: 2\nsweeps:\n"
        "- &sweep\n  layers: [{plane: result, template: {kind: causal, size: 5}}]\n  levels: [0]\n"
        "- <<: *sweep\n  levels: [1]\n"
    )
    assert [sweep.levels for sweep in load_recipe(path).sweeps] == [(0,), (1,)]


def test_values_can_be_set():
    recipe = load_recipe("wei_levoy", ["levels=2", "sweeps[0].layers[0].template.size=5", "boundary = open"])
    assert recipe == wei_levoy(levels=2, neighborhood=5, boundary="open")


def test_a_field_that_has_its_default_can_be_set():
    assert load_recipe("wei_levoy_single", ["sweeps[0].levels=[0]"]).sweeps[0].levels == (0,)


def test_a_null_that_is_not_the_default_is_kept():
    recipe = load_recipe("efros_leung", ["max_error=null"])
    assert recipe.sweeps[0].accept.max_error is None
    assert parse_recipe(yaml.safe_load(dump_recipe(recipe)), "x") == recipe


def test_setting_a_value_leaves_the_data_alone():
    data = yaml.safe_load(GOOD)
    parse_recipe(data, "x", ["levels=2"])
    assert data == yaml.safe_load(GOOD)


def test_the_schema_accepts_what_is_written():
    schema = recipe_schema()
    assert set(yaml.safe_load(GOOD)) <= set(schema["properties"])
    assert schema["additionalProperties"] is False


MISTAKES = {
    'levels: "4"': ("levels: 4", "'levels': input should be a valid integer, but it is \"4\"; change it"),
    "levels: 2.5": ("levels: 4", "'levels': input should be a valid integer, but it is 2.5"),
    "levels: true": ("levels: 4", "'levels': input should be a valid integer, but it is true"),
    "levels: null": ("levels: 4", "'levels': input should be a valid integer, but it is null"),
    "levels: .nan": ("levels: 4", "'levels': input should be a valid integer, but it is NaN"),
    "levels: 0": ("levels: 4", "'levels': input should be greater than or equal to 1, but it is 0"),
    "level: 4": ("levels: 4", "'level' must be a known field, but there is no such field; did you mean 'levels'?"),
    "levels: 4\nlevels: 3": ("levels: 4", "must be valid YAML, but line 4, column 1: the key 'levels' is there twice"),
    "levels: [": ("levels: 4", "must be valid YAML, but line 5, column 8: expected ',' or ']', got ':'"),
    "levels:\t4": ("levels: 4", "line 3, column 8: found character '\\t' that cannot start any token"),
    "levels: \x01": ("levels: 4", "must be valid YAML, but line 3: special characters are not allowed"),
    "levels: 4\n---\nname: x": ("levels: 4", "must be valid YAML, but line 4, column 1: found another document"),
    "? [a]\n: 3": ("levels: 4", "must be valid YAML, but line 3, column 3: found unhashable key"),
    "levels: 2020-13-45": ("levels: 4", "must be valid YAML, but month must be in 1..12"),
    "levels: 2020-01-01": ("levels: 4", "must hold plain numbers, texts and lists, but Object of type date"),
    "levels: &a [*a]": ("levels: 4", "must hold plain numbers, texts and lists, but Circular reference"),
    "levels: !!python/name:os x": ("levels: 4", "line 3, column 9: could not determine a constructor"),
    "levels: " + "[" * 3000: ("levels: 4", "must be valid YAML, but it is nested too deeply"),
    "levels: " + "x" * 3000: ("levels: 4", "but it is \"xxxxxxxxxxxxxxxxxxxxxxxxxxxxx...xxxx"),
    "boundary: round": ("boundary: torus", "'boundary': input should be 'torus' or 'open', but it is \"round\""),
    "search: {kind: exhaustive, depht: 3}": (
        "search: {kind: exhaustive}",
        "'sweeps[0].search.depht' must be a known field, but there is no such field; choose from: kind",
    ),
    "serach: {kind: exhaustive}": (
        "search: {kind: exhaustive}", "'sweeps[0].serach' must be a known field, but there is no such field; "
        "did you mean 'search'?",
    ),
    "order: {kind: shuffle, sed: 3}": (
        "order: {kind: scanline}", "'sweeps[0].order.sed' must be a known field, but there is no such field; "
        "did you mean 'seed'?",
    ),
    "{kind: causl, size: 9}": (
        "{kind: causal, size: 9}",
        "'sweeps[0].layers[0].template.kind' must be one of causal, anticausal, square, but it is 'causl'; "
        "did you mean 'causal'?",
    ),
    "{size: 9}": (
        "{kind: causal, size: 9}",
        "'sweeps[0].layers[0].template.kind' is required, but it is missing; add it",
    ),
    "{kind: causal, size: 8}": (
        "{kind: causal, size: 9}",
        "'sweeps[0].layers[0].template.size': a side must be odd, but 8 is even; change it",
    ),
    "{kind: causal, size: -3}": (
        "{kind: causal, size: 9}", "'sweeps[0].layers[0].template.size': input should be greater than or equal",
    ),
    "plane: coarse": (
        "plane: result",
        "the recipe: a sweep compares something at each of its levels, but at level 3 all its layers read above",
    ),
    "levels: [0]": ("normalize: false", "but no sweep runs on level 1, so it would stay noise; change it"),
    "levels: [9]": ("normalize: false", "a sweep names level 9, but with 4 levels the coarsest is 3"),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: mistake[:30])
def test_each_mistake_is_told(tmp_path, mistake):
    right, message = MISTAKES[mistake]
    path = tmp_path / "my.yaml"
    path.write_text(GOOD.replace(right, mistake, 1))
    with pytest.raises(ts.ConfigError, match=re.escape(message)) as caught:
        load_recipe(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < len(str(path)) + 300


WHOLE = {
    "": "must be a mapping of recipe fields, but it is empty; start from",
    "- a": "must be a mapping of recipe fields, but it is a list",
    "text": "must be a mapping of recipe fields, but it is a str",
    "levels: 3": "the recipe: a recipe has sweeps or patches, but this one has neither; change it",
    "levels: 3\nsweeps: []": "the recipe: a recipe has sweeps or patches, but this one has neither; change it",
    "sweeps: []": "'levels' is required, but it is missing; add it",
    "levels: 1\nsweeps: [{layers: []}]": "'sweeps[0].layers' must have 1 or more, but there is none; add one",
    "levels: 1\npatches: {kind: quilt}": "'patches.kind' must be one of quilting, graphcut, but it is 'quilt'; did you mean 'quilting'?",
    "levels: 1\npatches: {kind: quilting, blok: 3}": "'patches.blok' must be a known field, but there is no such field; did you mean 'block'?",
    "levels: 1\npatches: {kind: graphcut, sides: 3}": "'patches.sides' must be a known field, but there is no such field; choose from: k, kind, overlap, patch, refinements",
    "levels: 1\nstructure: {size: 4, recipe: {levels: 1}}": "'structure.size': a side must be odd, but 4 is even; change it",
    "levels: 1\nstructure: {operation: smear, recipe: {levels: 1}}": "'structure.operation': input should be 'erode', 'dilate' or 'auto', but it is \"smear\"; change it",
    "levels: 3\nsweeps: [3]": "'sweeps[0]': input should be an object, but it is 3",
    "levels: 3\nsweeps: {a: 1}": "'sweeps' must be a list, but it is",
    "levels: 3\nsweeps: [{layers: [{plane: result}]}]": "'sweeps[0].layers[0].template' is required",
}


@pytest.mark.parametrize("text", WHOLE)
def test_a_file_that_is_no_recipe_is_told(tmp_path, text):
    path = tmp_path / "my.yaml"
    path.write_text(text)
    with pytest.raises(ts.ConfigError, match=re.escape(WHOLE[text])):
        load_recipe(path)


def test_a_picture_is_no_recipe(tmp_path):
    (tmp_path / "my.yaml").write_bytes(b"\x89PNG\xff")
    with pytest.raises(ts.ConfigError, match=r"must be UTF-8 text, but it is not; is this YAML"):
        load_recipe(tmp_path / "my.yaml")


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("wei_levi", "wei_levi: must be one of the recipes analogy, ashikhmin, ashikhmin_multires, ashikhmin_target, coherent_fill, distorted, efros_leung, graphcut, improved_wl, quilting, quilting_transfer, random_order, wei_levoy, wei_levoy_fill, wei_levoy_single, wei_levoy_tsvq, or a .yaml file, but "
                     "there is no such recipe; did you mean 'wei_levoy'?"),
        ("fractal", "there is no such recipe; choose from: analogy, ashikhmin, ashikhmin_multires, ashikhmin_target, coherent_fill, distorted, efros_leung, graphcut, improved_wl, quilting, quilting_transfer, random_order, wei_levoy, wei_levoy_fill, wei_levoy_single, wei_levoy_tsvq"),
        ("nothing.yaml", "nothing.yaml: must be a readable file, but the system says: no such file"),
    ],
)  # fmt: skip
def test_an_unknown_recipe_is_told(source, message):
    with pytest.raises(ts.ConfigError, match=re.escape(message)):
        load_recipe(source)


OVERRIDES = {
    "levels": "--set levels: must look like path=value, but it does not; write e.g. --set levels=3",
    "=3": "must look like path=value",
    "levels..x=3": "must look like path=value",
    "sweeps[a]=3": "must look like path=value",
    "levels=[": "--set levels=[: must be valid YAML, but line 1, column 2: expected the node content",
    "initial={kind: noise, kind: noise}": "line 1, column 15: the key 'kind' is there twice",
    "sweeps[1].levels=[0]": "the path must exist in the recipe, but there is no 'sweeps[1]'; look the path up",
    "sweeps.levels=[0]": "there is no 'sweeps.levels'",
    "levels[0]=1": "there is no 'levels[0]'",
    "levels=four": 'wei_levoy: levels=four: must suit the recipe: input should be a valid integer, but it is "four"',
    "levels=": "wei_levoy: levels=: must suit the recipe: input should be a valid integer, but it is null",
    "levels=2020-01-01": 'input should be a valid integer, but it is "2020-01-01"',
    "sweeps[0].rows=2020-01-01": "must hold plain numbers, texts and lists, but Object of type date",
    "sweeps[0].serach={}": "'sweeps[0].serach' must be a known field",
    "sweeps[0].layers[0].template.size=8": "a side must be odd, but 8 is even",
}


@pytest.mark.parametrize("override", OVERRIDES)
def test_each_wrong_override_is_told(override):
    with pytest.raises(ts.ConfigError, match=re.escape(OVERRIDES[override])):
        load_recipe("wei_levoy", [override, "name=x"])


def test_parameters_of_a_recipe_function_can_be_set_by_name():
    made = load_recipe("ashikhmin", ["neighborhood=7", "noise=false", "name=mine"])
    assert made == ts.recipes.ashikhmin(neighborhood=7, noise=False).model_copy(update={"name": "mine"})
    sizes = load_recipe("wei_levoy", ["neighborhood=[9, 7, 5, 5]", "levels=4"])
    assert sizes == ts.recipes.wei_levoy(neighborhood=[9, 7, 5, 5])
    assert load_recipe("random_order", ["search=tsvq"]).sweeps[0].search.kind == "tsvq"


@pytest.mark.parametrize(
    ("name", "setting", "message"),
    [
        ("ashikhmin", "neighborhood=4", "ashikhmin: neighborhood=4: must suit the recipe: a side "
         "must be odd, but 4 is even; change it"),
        ("ashikhmin", "noise=maybe", 'must suit the recipe: input should be a valid boolean, but it is "maybe"'),
        ("random_order", "search=best", "input should be 'exhaustive', 'tsvq' or 'coherence', but it is \"best\""),
        ("ashikhmin_target", "passes=21", "passes: must be from 1 to 20, but it is 21"),
        ("ashikhmin", "search=tsvq", "'search' must be a known field, but there is no such field"),
    ],
)  # fmt: skip
def test_wrong_parameters_are_told(name, setting, message):
    with pytest.raises(ts.ConfigError, match=re.escape(message)):
        load_recipe(name, [setting])
