"""The form of a recipe: every value has its field, every verb is checked, and a browser can use it."""

from __future__ import annotations

import contextlib
import re

import pytest
import yaml

from tests.browser import browser, hosts, page, served  # noqa: F401 (fixtures)
from torchsynth.config import load_recipe, parse_recipe, recipe_schema
from torchsynth.errors import ConfigError
from torchsynth.recipes import RECIPES
from torchsynth.studio import docstrings, edits
from torchsynth.studio.edits import complete
from torchsynth.studio.fields import field_at, fields_of, read, written
from torchsynth.studio.parameters import made, parameters_of

gr = pytest.importorskip("gradio", reason="the studio needs gradio")
controls = pytest.importorskip("torchsynth.studio.controls")

SCHEMA = recipe_schema()


def data_of(name):
    return complete(RECIPES[name]())


def paths_in(schema, data, path=""):
    """Every property that the schema has at each place of the data: found without the form's code."""
    names = [] if "properties" in schema else re.findall(r"'\$ref': '#/\$defs/(\w+)'", repr(schema))
    definitions = [SCHEMA["$defs"][name] for name in names]
    if isinstance(data, list) and "prefixItems" not in repr(schema):
        for number, item in enumerate(data):
            yield from paths_in(schema, item, f"{path}[{number}]")
    elif isinstance(data, list):
        yield from (f"{path}[{number}]" for number in range(len(data)))
    elif isinstance(data, dict):
        kinds = [
            one for one in definitions if one["properties"].get("kind", {}).get("const") == data.get("kind")
        ]
        whole = kinds[0] if definitions else schema
        for name, place in whole["properties"].items():
            here = f"{path}.{name}".removeprefix(".")
            yield here
            yield from paths_in(place, data.get(name, place.get("default")), here)


def all_fields(data):
    return [field for top in fields_of(data) for field in top.walk()]


@pytest.mark.parametrize("name", RECIPES)
def test_no_value_of_the_schema_is_missing(name):
    data = data_of(name)
    fields = {field.path: field for field in all_fields(data)}
    wanted = set(paths_in(SCHEMA, data))
    kinds = {path for path in wanted if path.rpartition(".")[2] == "kind"}
    assert wanted - kinds <= set(fields)
    for path in kinds:
        assert fields[path.rpartition(".")[0]].kind in fields[path.rpartition(".")[0]].shape.words
    assert len(wanted) > 8


@pytest.mark.parametrize("name", RECIPES)
def test_what_controls_show_is_the_recipe(name):
    data = data_of(name)
    meant = {}
    for field in all_fields(data):
        if field.shape.control in ("list", "part"):
            continue  # what they hold has controls of its own
        value = controls.value_of(field, controls.shown(field))
        if field.shape.control == "kind":
            assert value == field.kind
        elif not field.children:
            meant[field.path] = value
    assert complete(parse_recipe(data, "x", [edits.override(*one) for one in meant.items()])) == data


def test_every_field_says_what_it_does():
    for definition in SCHEMA["$defs"].values():
        said = docstrings.arguments(definition["description"])
        assert set(definition["properties"]) - {"kind"} <= set(said), definition["title"]


def test_ranges_come_from_the_schema():
    data = data_of("wei_levoy_tsvq")
    levels = field_at(data, "levels").shape
    assert (levels.control, levels.minimum, levels.maximum, levels.step) == ("integer", 1, 16, 1)
    size = field_at(data, "sweeps[0].layers[0].template.size").shape
    assert (size.minimum, size.maximum, size.step) == (3, 255, 2)
    seams = field_at(data, "blur_seams").shape
    assert (seams.minimum, seams.maximum, seams.step, seams.optional) == (3, 15, 2, True)
    seed = field_at(data_of("random_order"), "sweeps[2].order.seed").shape
    assert (seed.minimum, seed.maximum) == (0, 2**32 - 1)
    assert field_at(data, "sweeps[0].search.depth").shape.optional


@pytest.mark.parametrize("name", RECIPES)
def test_main_parameters_rebuild_the_recipe(name):
    fields = parameters_of(name, {})
    usual = {field.path: read(field, written(field)) if field.shape.control == "integers" else field.value
             for field in fields}  # fmt: skip
    assert made(name, usual) == data_of(name) == made(name, {})
    assert made(name, {})["name"] == name
    assert all(field.help for field in fields)


def test_a_main_parameter_can_be_null():
    assert made("efros_leung", {"max_error": None})["sweeps"][0]["accept"]["max_error"] is None


def test_a_kind_keeps_what_it_shares_and_takes_the_rest_from_around():
    data = edits.with_kind(data_of("wei_levoy"), "sweeps[0].layers[0].template", "square")
    assert data["sweeps"][0]["layers"][0]["template"] == {"kind": "square", "size": 9, "center": True}
    data = edits.with_kind(data_of("wei_levoy"), "sweeps[0].search", "prefer_coherent")
    assert data["sweeps"][0]["search"]["template"] == {"kind": "causal", "size": 9}


def test_a_kind_that_does_too_much_by_default_leaves_it_out():
    accept = edits.with_kind(data_of("wei_levoy"), "sweeps[0].accept", "within_tolerance")["sweeps"][0][
        "accept"
    ]
    assert accept["max_error"] is None
    assert accept["growth"] == 1.1


@pytest.mark.parametrize(("name", "least"), [("wei_levoy_single", 13), ("efros_leung", 9), ("quilting", 3)])
def test_kinds_can_be_chosen(name, least):
    data = data_of(name)
    chosen = 0
    for field in all_fields(data):
        for kind in field.shape.kinds if field.shape.control == "kind" and field.value else ():
            with contextlib.suppress(ConfigError):
                chosen += field_at(edits.with_kind(data, field.path, kind), field.path).kind == kind
    assert chosen >= least


def test_items_are_added_moved_and_removed():
    data = data_of("wei_levoy")
    two = edits.added(data, "sweeps")
    assert two["sweeps"] == data["sweeps"] * 2
    assert edits.removed(two, "sweeps", 1) == data
    other = edits.changed(two, "sweeps[1].unknown", "skip")
    assert [sweep["unknown"] for sweep in edits.moved(other, "sweeps", 1, -1)["sweeps"]] == ["skip", "read"]
    assert edits.moved(data, "sweeps[0].layers", 0, -1) == data


def test_patches_and_sweeps_replace_each_other():
    quilted = edits.switched(data_of("wei_levoy"), "patches", True)
    assert quilted["patches"]["block"] == 36
    assert quilted["levels"] == 1
    wide = edits.changed(quilted, "patches.overlap", 6)
    assert edits.with_kind(wide, "patches", "graphcut")["patches"]["overlap"] == 0.25
    cut = edits.with_kind(quilted, "patches", "graphcut")
    assert cut["patches"]["refinements"] == 12
    assert len(edits.added(cut, "sweeps")["sweeps"]) == 1
    assert edits.switched(cut, "patches", False)["patches"] is None


def test_a_structure_comes_and_goes_with_a_guide():
    data = edits.switched(data_of("improved_wl"), "structure", False)
    again = edits.switched(data, "structure", True)
    assert again["structure"]["recipe"]["sweeps"]
    opened = edits.changed(edits.switched(data_of("analogy"), "structure", True), "boundary", "torus")
    assert opened["structure"]["recipe"]["boundary"] == "torus"
    with pytest.raises(ConfigError, match="no sweep has a layer on a guide plane"):
        edits.switched(data_of("wei_levoy"), "structure", True)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("sweeps[0].layers[0].template.size", 4, "must be odd|side must be odd, but 4 is even"),
        ("sweeps[0].levels", [7], "names level 7, but with 4 levels the coarsest is 3"),
        ("sweeps[0].levels", [0], "no sweep runs on level 1"),
        ("levels", 0, "'levels'.*greater than or equal to 1"),
        ("levels", None, "'levels'.*valid integer"),
        ("sweeps[0].rows", [0, 0.5], r"'sweeps\[0\].rows\[1\]'"),
        ("sweeps[0].levels", "fine", r"'sweeps\[0\].levels"),
    ],
)
def test_what_does_not_fit_is_told_with_its_path(path, value, message):
    data = data_of("wei_levoy")
    with pytest.raises(ConfigError, match=message):
        edits.changed(data, path, value)
    assert data == data_of("wei_levoy")


def test_a_file_is_edited_like_a_recipe_of_the_library():
    data = complete(
        yaml.safe_load(
            "{levels: 1, sweeps: [{layers: [{plane: result, template: {kind: causal, size: 5}}]}]}"
        )
    )
    assert parse_recipe(data, "x") == parse_recipe(complete(data), "x")
    small = edits.changed(data, "sweeps[0].layers[0].sigma", 1e-10)
    assert small["sweeps"][0]["layers"][0]["sigma"] == 1e-10
    assert load_recipe("wei_levoy", ["levels=2"]) == parse_recipe(
        edits.changed(data_of("wei_levoy"), "levels", 2), "x"
    )


@pytest.fixture(scope="module")
def address():
    from torchsynth.studio.form import CSS, recipe_form

    with gr.Blocks() as blocks:
        recipe = gr.State(data_of("wei_levoy"))
        message = gr.HTML(elem_id="message")
        recipe_form(recipe, message)
        text = gr.Textbox(elem_id="text", label="text")
        recipe.change(lambda data: yaml.safe_dump(data), recipe, text)
        other = gr.Button("other", elem_id="other")
        other.click(lambda: data_of("ashikhmin_target"), None, recipe)
    with served(blocks, css=CSS) as url:
        yield url


def control(page, path):  # noqa: F811
    return page.locator(f"#{controls.control_id(path)}")


def recipe_in(page, wanted):  # noqa: F811
    """The page's recipe, once it is as wanted."""
    from playwright.sync_api import expect

    area = page.locator("#text textarea")
    expect(area).to_have_value(re.compile(wanted, re.DOTALL))
    return yaml.safe_load(area.input_value())


def test_a_visitor_edits_a_recipe(address, page):  # noqa: F811
    from playwright.sync_api import expect

    page.goto(address)
    page.get_by_text("All parts of the recipe").click()
    levels = control(page, "levels").locator("input")

    levels.fill("3")  # a number, while it is typed
    assert recipe_in(page, "levels: 3")["levels"] == 3
    expect(levels).to_be_focused()
    expect(page.get_by_text("Parts below were changed by hand")).to_be_visible()

    levels.fill("0")  # what does not fit is told, and taken back once the control is left
    expect(page.locator("#message")).to_contain_text("'levels': input should be greater than or equal to 1")
    expect(levels).to_have_value("0")
    levels.blur()
    expect(levels).to_have_value("3")
    expect(page.locator("#message")).to_contain_text("greater than or equal to 1")

    control(page, "sweeps[0]").locator("> button").click()  # a kind
    control(page, "sweeps[0].search").locator("input").click()
    page.get_by_role("option", name="tsvq").click()
    assert recipe_in(page, "kind: tsvq")["sweeps"][0]["search"]["beam"] == 1
    beam = control(page, "sweeps[0].search.beam").locator("input")
    expect(beam).to_be_visible()  # its group stayed open
    beam.fill("4")
    recipe_in(page, "beam: 4")
    expect(page.locator("#message")).to_be_empty()

    size = control(page, "sweeps[0].layers[0].template.size").locator("input")
    size.fill("6")
    size.press("Enter")
    expect(page.locator("#message")).to_contain_text("a side must be odd, but 6 is even")
    expect(size).to_have_value("9")
    size.fill("41")
    size.press("Enter")
    recipe_in(page, "size: 41")

    control(page, "sweeps.add").click()  # items
    assert len(recipe_in(page, "beam: 4.*beam: 4")["sweeps"]) == 2
    expect(control(page, "sweeps[1]")).to_contain_text("Sweep 2: scanline, tsvq, all levels")
    control(page, "sweeps[0].remove").click()
    expect(control(page, "sweeps[1]")).to_have_count(0)

    control(page, "main.neighborhood").locator("input").fill("7")  # all anew
    control(page, "main.neighborhood").locator("input").press("Enter")
    rebuilt = recipe_in(page, "size: 7")
    assert rebuilt == made("wei_levoy", {"neighborhood": 7})
    expect(levels).to_have_value("4")
    expect(page.get_by_text("Parts below were changed by hand")).to_be_hidden()

    page.locator("#other").click()  # a recipe from elsewhere
    expect(control(page, "main.passes")).to_be_visible()
    assert recipe_in(page, "ashikhmin_target") == data_of("ashikhmin_target")
    expect(levels).to_have_value("1")
    assert hosts(page) == {"127.0.0.1"}


def test_each_visitor_has_a_recipe(address, browser, page):  # noqa: F811
    page.goto(address)
    page.get_by_text("All parts of the recipe").click()
    control(page, "levels").locator("input").fill("2")
    recipe_in(page, "levels: 2")
    second = browser.new_page()
    second.goto(address)
    second.get_by_text("All parts of the recipe").click()
    from playwright.sync_api import expect

    expect(control(second, "levels").locator("input")).to_have_value("4")
    second.close()
