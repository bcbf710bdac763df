"""The studio: its parts, and the page in a real browser."""

from __future__ import annotations

import base64
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
import urllib.request
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from PIL import Image

import torchsynth as ts
from torchsynth.cli import main
from torchsynth.io import encode_image, read_picture
from torchsynth.source_map import read_source_map
from torchsynth.studio import painting, palette, running, visitor, work
from torchsynth.studio.offline import without_foreign_tags
from torchsynth.studio.pictures import Pyramids, bar, data_url

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
SIDE = 32


def layer_url(layer):
    buffer = io.BytesIO()
    Image.fromarray(layer).save(buffer, "PNG")
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


# --- What was painted ---------------------------------------------------------------------------------------


def test_painted_colors_come_as_they_were_painted():
    layer = np.zeros((2, 3, 4), np.uint8)
    layer[0, 1] = (10, 20, 30, 255)
    read = painting.layer_of(layer_url(layer), (2, 3), "target")
    assert painting.region_of(read).tolist() == [[False, True, False], [False] * 3]
    assert (painting.target_of(read, 3)[:, 0, 1] * 255).round().tolist() == [10, 20, 30]
    assert (painting.target_of(read, 1)[:, 0, 1] * 255).round().tolist() == [20]
    assert painting.target_of(read, 4)[3].unique().tolist() == [1.0]


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("", "nothing is painted yet"),
        (None, "nothing is painted yet"),
        (layer_url(np.zeros((2, 2, 4), np.uint8)), "nothing is painted yet"),
        (layer_url(np.full((3, 2, 4), 255, np.uint8)), "it was painted at 3x2"),
        ("data:image/png;base64,AAAA", "it is no PNG"),
        ("/etc/passwd", "it is no PNG"),
    ],
)
def test_what_is_no_painting_is_told(value, message):
    with pytest.raises(ts.InputError, match=message):
        painting.layer_of(value, (2, 2), "hole")


def test_palette_holds_rare_colors_of_the_sample_and_only_its_colors():
    image = torch.rand(3, 20, 20) / 8 + 0.3
    image[:, :2, :2] = torch.tensor([1.0, 0.0, 0.0]).view(3, 1, 1)
    colors = palette.palette(image)
    own = {palette.color_at(image, row, column) for row in range(20) for column in range(20)}
    assert "#ff0000" in colors
    assert set(colors) <= own
    assert colors == palette.palette(image)


# --- Running ------------------------------------------------------------------------------------------------


def test_a_run_is_followed_to_its_end(make_exemplar):
    sample = make_exemplar(3)
    news = list(
        running.followed(
            lambda progress: ts.synthesize(sample, (8, 8), ts.recipes.ashikhmin(), progress=progress),
            running.Ticket(), pause=0.0,
        )
    )  # fmt: skip
    assert isinstance(news[-1], running.Finished)
    assert news[0].begins
    assert news[0].done == 0
    assert all(one.total == news[0].total for one in news[:-1])


def test_a_cancelled_run_ends_and_the_computation_with_it(make_exemplar):
    sample, ticket = make_exemplar(3), running.Ticket()
    calls = []

    def endless(progress):
        while True:
            calls.append(len(calls))
            progress(0, 0, 0, 1, lambda: sample[None])
            time.sleep(0.001)

    news = running.followed(endless, ticket, pause=0.0)
    next(news)
    ticket.cancel()
    with pytest.raises(running.CancelledError):
        list(news)
    ended = len(calls)
    time.sleep(0.05)
    assert ticket.ended
    assert len(calls) == ended


def test_an_error_in_a_run_reaches_whoever_follows_it():
    def wrong(_):
        raise ts.InputError("a", "b", "c", "d")

    with pytest.raises(ts.InputError, match="a: b, but c; d"):
        list(running.followed(wrong, running.Ticket()))


def test_a_visitor_who_leaves_ends_the_computation():
    ended = threading.Event()

    def endless(progress):
        try:
            while True:
                progress(0, 0, 0, 1, lambda: torch.zeros(1, 1, 1, 1))
                time.sleep(0.001)
        finally:
            ended.set()

    news = running.followed(endless, running.Ticket(), pause=0.0)
    next(news)
    news.close()
    assert ended.wait(5)


def test_a_new_run_of_a_visitor_ends_the_one_before_and_no_other():
    one, other = visitor.Visitor(), visitor.Visitor()
    first, foreign = one.begin(), other.begin()
    one.begin()
    assert first.cancelled
    assert not foreign.cancelled


def test_files_of_a_visitor_are_removed():
    who = visitor.Visitor()
    folder = who.files("result")
    (folder / "a").write_text("a")
    who.close()
    assert not folder.exists()


# --- Work and pictures --------------------------------------------------------------------------------------


def test_a_wrong_picture_is_called_by_its_name(tmp_path):
    (tmp_path / "notes.png").write_text("no picture")
    with pytest.raises(ts.InputError, match=r"^photo\.png: must be a PNG"):
        work.read_sample(str(tmp_path / "notes.png"), "photo.png")


def test_too_much_for_a_page_is_refused_before_any_work():
    sample = work.read_sample("sample:brick", "sample:brick")
    with pytest.raises(ts.InputError, match="1,048,576 pixels, but 2000x2000 are 4,000,000"):
        work.synthesis(sample, ts.recipes.ashikhmin(), (2000, 2000), 0)


def test_a_huge_picture_is_refused_before_it_is_decoded(tmp_path, monkeypatch):
    Image.new("1", (13_000, 13_000)).save(tmp_path / "huge.png")
    monkeypatch.setattr(work, "read_picture", pytest.fail)
    with pytest.raises(
        ts.InputError, match=r"huge\.png: the page works with up to 1,048,576 pixels, but it has 169,000,000"
    ):
        work.read_upload(str(tmp_path / "huge.png"))


def test_the_last_result_is_filled_from_itself():
    sample = work.read_sample("sample:pebbles", "sample:pebbles")
    made = ts.synthesize(sample.picture.image, (24, 24), ts.recipes.ashikhmin(), seed=1)
    last = visitor.Sample("last result", replace(sample.picture, image=made.image[0]))
    hole = torch.zeros(24, 24, dtype=torch.bool)
    hole[8:12, 8:12] = True
    wanted = work.filling(last, hole, None, 0)
    filled = wanted.make(lambda *_: None)
    assert wanted.sample is last
    assert filled.transfer(made.image[0]).equal(filled.image)


def test_one_more_pass_is_one_more():
    sample = work.read_sample("sample:pebbles", "sample:pebbles")
    controls = ts.Controls(target=sample.picture.image[:, :16, :16])
    first = work.following(sample, ts.recipes.ashikhmin(), (16, 16), 3, controls, 1)
    made = first.make(lambda *_: None)
    again = work.one_more_pass(made, sample, 3, controls)
    refined = ts.refine(sample.picture.image, made, controls=controls, seed=3)
    assert again.make(lambda *_: None).source.equal(refined.source)
    assert not refined.source.equal(made.source)


def test_pyramids_show_what_is_known():
    pyramids = Pyramids([torch.rand(1, 3, 8, 8), torch.rand(1, 3, 4, 4)])
    assert pyramids.html().count("<img") == 2
    pyramids.put("result", 1, torch.rand(1, 3, 4, 4))
    assert pyramids.html().count("<img") == 3
    assert pyramids.html().index("level 1") < pyramids.html().index("level 0")


def test_texts_are_escaped():
    assert "<script>" not in bar("<script>", 0.0)


def test_pictures_in_the_page_keep_every_value():
    image = (torch.arange(256).view(1, 16, 16) / 255).expand(3, -1, -1)
    data = base64.b64decode(data_url(image).partition(",")[2])
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(data)))[..., 0].reshape(-1), np.arange(256))


def test_foreign_tags_are_taken_out_and_own_ones_stay():
    page = b'<link href="./a.css"><meta content="https://x.example/a.png"><script src="./b.js"></script>'
    assert without_foreign_tags(page) == b'<link href="./a.css"><script src="./b.js"></script>'


# --- The command --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ask", [signal.SIGINT, signal.SIGTERM])
def test_command_serves_until_it_is_asked_to_end(unused_port, ask):
    begun = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "torchsynth", "studio", "--port", str(unused_port)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    line = process.stdout.readline()
    print(f"ready after {time.perf_counter() - begun:.1f} s")
    address = f"http://127.0.0.1:{unused_port}/"
    assert address in line
    with urllib.request.urlopen(address) as answer:
        assert b"torchsynth studio" in answer.read()
    process.send_signal(ask)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out, err) == (0, "", "")


def test_taken_port_is_one_clear_error(server, capsys):
    port = server.rstrip("/").rpartition(":")[2]
    assert main(["studio", "--port", port]) == 2
    assert f"127.0.0.1:{port}: must be a free address of this machine" in capsys.readouterr().err


def test_missing_gradio_is_one_clear_error(monkeypatch, capsys):
    monkeypatch.setattr("torchsynth.studio.server.find_spec", lambda _: None)
    assert main(["studio", "--port", "0"]) == 2
    assert 'pip install "torchsynth-textures[studio]"' in capsys.readouterr().err


@pytest.fixture
def unused_port():
    import socket

    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


# --- The page -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def server():
    """The studio in this process, at a port of its own."""
    from torchsynth.studio.server import serving

    with serving("127.0.0.1", 0, max_upload=1) as address:
        yield address


@pytest.fixture(scope="module")
def browser():
    """Chromium, or a reason why not; continuous integration has to have it."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        sync_playwright = None
    if CHROMIUM is None or sync_playwright is None:
        missing = "Chromium" if CHROMIUM is None else "playwright"
        assert os.environ.get("CI") != "true", f"continuous integration needs {missing}"
        pytest.skip(f"{missing} is not installed")
    with sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield started
        started.close()


class Page:
    """The page as a visitor uses it."""

    def __init__(self, browser, address):
        self.page = browser.new_page(viewport={"width": 1280, "height": 900})
        self.page.set_default_timeout(45_000)
        self.asked, self.refused = [], []
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.on(
            "console",
            lambda message: self.refused.append(message.text) if "Content Security" in message.text else None,
        )
        self.page.on("pageerror", lambda error: self.refused.append(str(error)))
        self.page.goto(address)
        self.page.wait_for_selector("#sample img")

    def upload(self, path, button="upload-sample"):
        with self.page.expect_file_chooser() as chooser:
            self.page.click(f"#{button}")
        chooser.value.set_files(path)

    def use(self, path, size=24):
        self.upload(path)
        self.page.wait_for_selector(f"#about-sample:has-text('{Path(path).name}')")
        for field in ("height", "width"):
            self.page.fill(f"#{field} input", str(size))
            self.page.press(f"#{field} input", "Tab")

    def tab(self, name):
        self.page.click(f"button[role=tab]:has-text('{name}')")

    def recipe(self, name):
        self.page.click("#recipe input")
        self.page.get_by_role("option", name=name, exact=True).click()
        self.page.wait_for_selector(f"#about-recipe:has-text('{name}')")

    def start(self, button):
        self.page.evaluate("document.querySelector('#progress .said').className = 'said'")
        self.page.click(f"#{button}")

    def run(self, button, state="done"):
        self.start(button)
        self.page.wait_for_selector(f"#progress .said.{state}", timeout=60_000)
        return self.page.inner_text("#progress .said")

    def pixels(self, element="shown-result"):
        source = self.page.get_attribute(f"#{element} img", "src")
        with urllib.request.urlopen(source) as answer:  # noqa: S310 (this machine)
            return np.asarray(Image.open(io.BytesIO(answer.read())).convert("RGB"))

    def paint(self, canvas, *points):
        box = self.page.locator(f"#{canvas} canvas").bounding_box()
        places = [(box["x"] + x * box["width"], box["y"] + y * box["height"]) for x, y in points]
        self.page.mouse.move(*places[0])
        self.page.mouse.down()
        for place in places[1:]:
            self.page.mouse.move(*place)
        self.page.mouse.up()

    def download(self, button):
        self.page.wait_for_selector(f"#{button}:not([disabled])")
        with self.page.expect_download() as found:
            self.page.click(f"#{button}")
        return Path(found.value.path()), found.value.suggested_filename

    def told(self, text):
        self.page.wait_for_selector(f".toast-body:has-text('{text}')")
        said = self.page.inner_text(".toast-body")
        assert "Traceback" not in said
        return said


@pytest.fixture
def visit(browser, server):
    """Open the page anew, for one more visitor."""
    opened = []

    def visit():
        opened.append(Page(browser, server))
        return opened[-1]

    yield visit
    for one in opened:
        assert [url for url in one.asked if not url.startswith((server, "data:", "blob:"))] == []
        assert one.refused == []
        one.page.context.close()


@pytest.fixture(scope="module")
def sample(tmp_path_factory):
    """Two colored samples as files, and what is in them."""
    folder = tmp_path_factory.mktemp("samples")
    found = []
    for seed in (0, 1):
        noise = torch.rand(3, SIDE, SIDE, generator=torch.Generator().manual_seed(seed))
        path = ts.write_image(noise * 0.5 + 0.5 * seed, folder / f"sample{seed}.png")
        found.append(SimpleNamespace(path=str(path), picture=read_picture(path)))
    return found


def test_synthesis_is_that_of_the_library_and_can_be_taken_home(visit, sample, tmp_path):
    page = visit()
    page.use(sample[0].path)
    assert "24 x 24" in page.run("synthesize")
    expected = ts.synthesize(sample[0].picture.image, (24, 24), ts.recipes.ashikhmin(), seed=0)
    shown = (expected.image[0].permute(1, 2, 0) * 255).round().byte().numpy()
    assert np.array_equal(page.pixels(), shown)
    picture, name = page.download("download-image")
    assert name == "sample0-ashikhmin.png"
    assert picture.read_bytes() == encode_image(expected.image[0], Path(name), "8-bit")
    saved = read_source_map(page.download("download-source_map")[0])
    source, size = saved.source, saved.exemplar
    assert torch.equal(source, expected.source)
    assert size == (SIDE, SIDE)
    recipe, name = page.download("download-recipe")
    shutil.copy(recipe, tmp_path / name)
    assert ts.load_recipe(tmp_path / name) == ts.recipes.ashikhmin()
    record = json.loads(page.download("download-record")[0].read_text())
    assert record["inputs"]["exemplar"] == {"path": "sample0.png", "sha256": sample[0].picture.sha256}
    assert page.page.locator("#pyramids img").count() == 3


def test_every_level_is_shown_and_a_yaml_decides(visit, sample, tmp_path):
    page = visit()
    page.use(sample[0].path)
    changed = ts.load_recipe("wei_levoy", ["levels=2", "neighborhood=5", "parent=3"]).changed(name="mine")
    file = tmp_path / "mine.yaml"
    file.write_text(ts.dump_recipe(changed))
    page.page.click("#yaml-panel button")
    page.upload(file, "load-yaml")
    page.page.wait_for_selector("#about-recipe:has-text('mine')")
    page.run("synthesize")
    page.page.wait_for_function("document.querySelectorAll('#pyramids img').length === 6")
    expected = ts.synthesize(sample[0].picture.image, (24, 24), changed, seed=0)
    assert np.array_equal(page.pixels(), (expected.image[0].permute(1, 2, 0) * 255).round().byte().numpy())


def test_target_is_painted_with_colors_of_the_sample_pass_by_pass(visit, sample):
    page = visit()
    page.use(sample[1].path)
    page.tab("Target")
    page.page.wait_for_selector("#target .swatch")
    colors = [one.get_attribute("title") for one in page.page.locator("#target .swatch").all()]
    assert colors == palette.palette(sample[1].picture.image)
    assert "nothing is painted yet" in page.run("first-pass", "failed")
    page.paint("target", (0.1, 0.5), (0.9, 0.5))
    page.run("first-pass")
    first = page.pixels()
    said = page.run("one-more-pass")
    assert "with target" in said
    assert not np.array_equal(page.pixels(), first)


def test_a_click_on_the_sample_gives_its_color_to_the_brush(visit, sample):
    page = visit()
    page.use(sample[0].path)
    page.tab("Target")
    box = page.page.locator("#sample img").bounding_box()
    cell = box["height"] / SIDE
    middle = box["x"] + box["width"] / 2 - box["height"] / 2
    page.page.mouse.click(middle + 3.5 * cell, box["y"] + 5.5 * cell)
    color = palette.color_at(sample[0].picture.image, 5, 3)
    page.page.wait_for_selector(f"#target .swatch[title='{color}']")


def test_a_painted_hole_is_filled_and_the_rest_stays(visit, sample):
    page = visit()
    page.use(sample[0].path)
    page.tab("Fill")
    page.page.wait_for_selector("#hole img")
    page.paint("hole", (0.4, 0.4), (0.6, 0.6))
    page.run("fill")
    before = (sample[0].picture.image.permute(1, 2, 0) * 255).round().byte().numpy()
    changed = (page.pixels() != before).any(2)
    assert changed.any()
    assert not changed[:6].any()
    assert not changed[:, :6].any()


def test_a_field_is_chosen_and_drawn(visit, sample):
    page = visit()
    page.use(sample[0].path, 16)
    page.tab("Distort")
    page.run("distort")
    expected = ts.synthesize(
        sample[0].picture.image, (16, 16), ts.recipes.distorted(levels=2),
        controls=ts.Controls(angle=ts.field.swirl((16, 16), 180.0)),
    )  # fmt: skip
    assert np.array_equal(page.pixels(), (expected.image[0].permute(1, 2, 0) * 255).round().byte().numpy())
    assert page.pixels("shown-field").shape == (16, 16, 3)


def test_two_recipes_are_compared(visit):
    page = visit()
    page.tab("Compare")
    page.page.click("#recipe-b input")
    page.page.get_by_role("option", name="quilting", exact=True).click()
    page.run("compare")
    page.page.wait_for_selector("#measures td")
    assert re.search(r"time\s+\d+\.\d\d s\s+\d+\.\d\d s", page.page.inner_text("#measures"))
    assert not np.array_equal(page.pixels("result-a"), page.pixels("result-b"))


def test_a_long_run_is_cancelled_and_the_page_goes_on(visit, sample):
    page = visit()
    page.recipe("wei_levoy")
    for field in ("height", "width"):
        page.page.fill(f"#{field} input", "600")
        page.page.press(f"#{field} input", "Tab")
    page.start("synthesize")
    page.page.wait_for_selector("#shown-result img")
    running_threads = threading.active_count()
    page.page.click("#cancel")
    page.page.wait_for_selector("#progress .said:text-is('Cancelled')", timeout=60_000)
    assert threading.active_count() <= running_threads
    page.use(sample[0].path)
    page.recipe("ashikhmin")
    assert "Done" in page.run("synthesize")


def test_a_wrong_file_gives_a_message(visit, tmp_path):
    page = visit()
    file = tmp_path / "notes.png"
    file.write_text("this is no picture")
    page.upload(file)
    assert "notes.png: must be a PNG, JPEG, TIFF, BMP or WebP image" in page.told("notes.png")
    page.page.wait_for_selector("#about-sample:has-text('sample:pebbles')")
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("levels: many")
    page.page.click("#yaml-panel button")
    page.upload(wrong, "load-yaml")
    page.page.wait_for_selector(".toast-body:has-text('wrong.yaml')")


def test_a_large_file_is_refused(visit, tmp_path):
    page = visit()
    file = tmp_path / "large.png"
    file.write_bytes(bytes(2_000_000))
    page.upload(file)
    page.told("maximum")
    assert "sample:pebbles" in page.page.inner_text("#about-sample")


def test_yaml_counts_as_soon_as_the_editor_is_left(visit):
    page = visit()
    page.page.click("#yaml-panel button")
    page.page.click("#yaml .cm-content")
    page.page.keyboard.press("Control+A")
    page.page.keyboard.insert_text(ts.dump_recipe(ts.recipes.ashikhmin().changed(name="typed")))
    page.page.wait_for_selector("#pending-yaml:has-text('not applied yet')")
    page.page.click("#title")
    page.page.wait_for_selector("#about-recipe:has-text('typed')")
    assert "typed" in page.run("synthesize")
    page.page.wait_for_selector("#pending-yaml:not(:has-text('not applied'))", state="attached")
    page.page.click("#yaml .cm-content")
    page.page.keyboard.press("Control+A")
    page.page.keyboard.insert_text("levels: many")
    page.tab("Target")
    page.page.wait_for_selector("#pending-yaml:has-text('Not applied. YAML')")
    assert 'it is "many"' in page.page.inner_text("#pending-yaml")


def test_a_painting_stays_in_another_size_and_its_output_has_no_record(visit, sample):
    page = visit()
    page.use(sample[0].path)
    page.tab("Target")
    page.page.wait_for_selector("#target .swatch")
    page.paint("target", (0.0, 0.5), (0.99, 0.5))
    for typed, rows in (("4", 4), ("48", 48)):
        page.page.fill("#height input", typed)
        page.page.wait_for_function(f"document.querySelector('#target canvas').height === {rows}")
    share = page.page.evaluate(
        """() => {
            const layer = document.querySelector("#target canvas");
            const data = layer.getContext("2d").getImageData(0, 0, layer.width, layer.height).data;
            return data.filter((_, index) => index % 4 === 3 && data[index] === 255).length / layer.width / layer.height;
        }"""
    )
    assert 0.2 < share < 0.5  # eight of 24 rows
    page.run("first-pass")
    assert page.pixels().shape == (48, 24, 3)
    page.page.wait_for_selector("#missing:has-text('No record')")


def test_a_recipe_that_needs_more_says_where_that_is_given(visit):
    page = visit()
    page.recipe("coherent_fill")
    assert "use the Fill tab" in page.run("synthesize", "failed")
    page.tab("Compare")
    assert page.page.input_value("#recipe-b input") == "wei_levoy"
    page.recipe("wei_levoy")
    page.page.wait_for_function("document.querySelector('#recipe-b input').value === 'ashikhmin'")


@pytest.mark.parametrize(
    ("field", "typed", "fact"),
    [("height", "12.5", "it is 12.5"), ("width", "-3", "it is -3"), ("height", "", "it is empty"), ("seed", "-1", "it is -1")],
)  # fmt: skip
def test_a_number_that_cannot_be_is_told_by_its_field(visit, capfd, field, typed, fact):
    page = visit()
    page.page.fill(f"#{field} input", typed)
    page.page.press(f"#{field} input", "Tab")
    said = page.run("synthesize", "failed")
    assert said.startswith(f"{field.capitalize()}: must be a whole number from ")
    assert fact in said
    assert page.page.locator(".toast-body").count() == 1
    assert capfd.readouterr().err == ""


def test_two_visitors_do_not_mix(visit, sample):
    one, other = visit(), visit()
    one.use(sample[0].path)
    other.use(sample[1].path)
    one.run("synthesize")
    other.run("synthesize")
    assert one.pixels().max() < 128 <= other.pixels().min()
    assert one.download("download-image")[1] == "sample0-ashikhmin.png"
