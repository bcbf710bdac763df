"""Image quilting and texture transfer, against literal loops and brute force."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import pytest
import torch
import yaml
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

import torchsynth as ts
from tests.reference import quilting as literal
from torchsynth import cli, config
from torchsynth.neighborhood import Plane, quantize
from torchsynth.patches import matching
from torchsynth.patches.cut import beyond_cuts, boundary_cut
from torchsynth.patches.layout import spots
from torchsynth.patches.matching import Matcher, Query, check_exact, fast_length, near_best, pick

DRAWS = 2**31


def _whole(image):
    """A picture as the reference wants it: rows, columns, channels of whole numbers."""
    return ((image * 255).round().long() - 128).permute(1, 2, 0).numpy()


def _plane(image, valid=None):
    return Plane(quantize(image[None], torch.float64), tuple(image.shape[1:]), "open", valid)


@given(st.lists(st.integers(0, 4), min_size=15, max_size=15))
def test_a_cut_is_the_cheapest_of_all(costs):
    error = torch.tensor(costs).double().view(1, 5, 3)
    every = [
        path
        for path in itertools.product(range(3), repeat=5)
        if all(abs(one - other) <= 1 for one, other in itertools.pairwise(path))
    ]
    paid = {path: sum(float(error[0, row, column]) for row, column in enumerate(path)) for path in every}
    (found,) = map(tuple, boundary_cut(error).tolist())
    assert paid[found] == min(paid.values())
    # Of the cheapest ones, that with the lowest columns, from the last row on.
    assert found == min((path for path in every if paid[path] == paid[found]), key=lambda path: path[::-1])


def test_cuts_of_a_batch_are_those_of_its_blocks():
    error = torch.randint(0, 50, (4, 7, 7)).double()
    together = beyond_cuts(error, (2, 3, 1, 2))
    assert together.equal(torch.cat([beyond_cuts(one, (2, 3, 1, 2)) for one in error.split(1)]))
    assert (together.flatten(1).sum(1) > 0).all()
    assert beyond_cuts(error, (0, 0, 0, 0)).all()


@pytest.mark.parametrize("valid", [False, True])
@pytest.mark.parametrize("exemplars", [1, 3])
def test_matching_equals_brute_force(valid, exemplars):
    pictures = torch.rand(exemplars, 2, 11, 13)
    region = torch.rand(11, 13) > 0.02 if valid else None
    plane = Plane(quantize(pictures, torch.float32), (11, 13), "open", region)
    queries = [
        Query(torch.randint(0, 1000, (4, 5)).double(), torch.randint(-128, 128, (3, 2, 4, 5)).double()) for _ in range(2)
    ]  # fmt: skip
    matcher = Matcher.of(plane)
    found = matcher.costs(queries)
    whole = plane.values.double().transpose(1, 2).unflatten(2, (11, 13)).expand(3, -1, -1, -1)
    for row, column in itertools.product(range(8), range(9)):
        block = whole[:, :, row : row + 4, column : column + 5]
        costs = sum((query.weights * (block - query.values).square()).sum((1, 2, 3)) for query in queries)
        assert found[:, row, column].equal(costs)
        inside = region is None or bool(region[row : row + 4, column : column + 5].all())
        assert bool(matcher.places((4, 5))[row, column]) == inside


def test_matching_is_exact_at_its_largest():
    """Extreme values all over, and the heaviest weights: transforms are off most there."""
    picture = torch.where(torch.rand(1, 1, 300, 211) > 0.5, 1.0, 0.0)
    values = torch.where(torch.rand(1, 1, 60, 60) > 0.5, 127.0, -128.0).double()
    query = Query(torch.full((60, 60), 1000.0).double(), values)
    found = Matcher.of(_plane(picture[0])).costs([query])[0]
    whole = quantize(picture, torch.float64).view(300, 211)
    for row, column in ((0, 0), (240, 151), (17, 80)):
        block = whole[row : row + 60, column : column + 60]
        assert found[row, column] == 1000 * (block - values[0, 0]).square().sum()


def test_pictures_too_large_for_exact_matching_are_refused():
    with pytest.raises(ts.InputError, match="must be small enough for exact matching of patches, but at"):
        check_exact((2**20, 2**20), 1e6, 1e12)


def test_matching_for_quilting_is_exact_for_larger_pictures_than_for_transfer():
    """In quilting every pixel counts once, in transfer a thousand times."""
    plane = Plane(torch.zeros(1, 600 * 600, 3), (600, 600), "open")
    ts.Quilting(block=500).check(plane, (600, 600), "open")
    with pytest.raises(ts.InputError, match="must be small enough for exact matching"):
        ts.Quilting(block=500, passes=1).check(plane, (600, 600), "open")


def test_fast_lengths_have_small_factors_only():
    small = {2**a * 3**b * 5**c for a in range(10) for b in range(7) for c in range(5)}
    assert [fast_length(one) for one in range(1, 513)] == [
        min(length for length in small if length >= one) for one in range(1, 513)
    ]


def test_near_best_on_perfect_and_on_impossible_places():
    inf = float("inf")
    costs = torch.tensor([[0.0, 0.0, inf], [0.0, 5.0, 6.0], [3.0, inf, 3.2]]).double()
    assert near_best(costs, 0.1, verbatim=False).tolist() == [
        [True, True, False], [True, True, False], [True, False, True],
    ]  # fmt: skip
    assert near_best(costs, 0.1, verbatim=True)[1].tolist() == [True, False, False]


def test_every_place_is_picked_by_its_share_of_the_draws():
    chances = torch.tensor([[3, 0, 1, 4]])
    draws = (torch.arange(8) * 2 + 1) * (DRAWS // 16)
    picked = [int(pick(chances, one.view(1, 1))) for one in draws]
    assert picked == [0, 0, 0, 2, 3, 3, 3, 3]
    large = torch.tensor([[2**45, 2**45]])
    assert [
        int(pick(large, torch.tensor([[one]]))) for one in (0, DRAWS // 2 - 1, DRAWS // 2, DRAWS - 1)
    ] == [0, 0, 1, 1]


def _draws(seed, *numbers):
    generator = torch.Generator().manual_seed(seed)
    return [torch.randint(DRAWS, (number,), generator=generator).tolist() for number in numbers]


@pytest.mark.parametrize("torus", [False, True])
@pytest.mark.parametrize(
    ("block", "overlap", "size", "tolerance", "verbatim", "channels"),
    [(5, 1, (13, 16), 0.1, False, 1), (6, 2, (14, 9), 0.5, True, 3), (5, 2, (5, 11), 0.0, False, 2)],
)
def test_quilting_equals_the_literal_loop(
    make_exemplar, torus, block, overlap, size, tolerance, verbatim, channels
):
    exemplar = make_exemplar(channels, 12, 14)
    valid = torch.ones(12, 14, dtype=torch.bool)
    valid[7:9, 3] = False
    recipe = ts.recipes.quilting(
        block=block,
        overlap=overlap,
        tolerance=tolerance,
        verbatim=verbatim,
        boundary="torus" if torus else "open",
    )
    result = ts.synthesize(ts.Exemplar(exemplar, valid), size, recipe, seed=3)
    (draws,) = _draws(3, 200)
    image, source = literal.quilt(
        _whole(exemplar), valid.numpy(), size, block=block, overlap=overlap, torus=torus, tolerance=tolerance,
        verbatim=verbatim, draw=lambda number: draws[number],
    )  # fmt: skip
    assert result.source[0].permute(1, 2, 0).equal(torch.from_numpy(source))
    assert (_whole(result.image[0]) == image).all()


@pytest.mark.parametrize("passes", [1, 3])
@pytest.mark.parametrize("boundary", ["open", "torus"])
def test_transfer_equals_the_literal_loop(make_exemplar, passes, boundary):
    exemplar, target = make_exemplar(2, 13, 12), make_exemplar(2, 15, 14, seed=5)
    region = torch.rand(15, 14) > 0.3
    recipe = ts.recipes.quilting_transfer(block=8, overlap=2, passes=passes, boundary=boundary)
    result = ts.synthesize(
        exemplar, (15, 14), recipe, seed=4, controls=ts.Controls(target=target, target_region=region)
    )
    blocks = [len(literal.starts(15, side, lap, boundary == "torus")) * len(literal.starts(14, side, lap, boundary == "torus"))
              for side, lap in recipe.patches.sides()]  # fmt: skip
    draws = _draws(4, *blocks)
    _, source = literal.transfer(
        _whole(exemplar), torch.ones(13, 12, dtype=torch.bool).numpy(), _whole(target), region.numpy(),
        passes=passes, block=8, overlap=2, torus=boundary == "torus", tolerance=0.1, verbatim=False,
        draw=lambda number, block: draws[number][block],
    )  # fmt: skip
    assert result.source[0].permute(1, 2, 0).equal(torch.from_numpy(source))


def test_transfer_follows_its_target():
    exemplar = ts.read_image("sample:grass").mean(0, keepdim=True)
    rows = torch.linspace(exemplar.min().item(), exemplar.max().item(), 60)
    target = rows.view(1, 60, 1).expand(1, 60, 60)
    result = ts.synthesize(
        exemplar, (60, 60), ts.recipes.quilting_transfer(block=12), controls=ts.Controls(target=target)
    )
    top, bottom = result.image[0, 0, :20].mean(), result.image[0, 0, 40:].mean()
    assert bottom - top > 0.2


@pytest.mark.parametrize(
    ("side", "block", "overlap"), [(37, 30, 14), (12, 9, 4), (13, 10, 4), (36, 36, 6), (80, 12, 2)]
)
def test_on_a_torus_blocks_end_in_a_cut_wherever_something_lies(side, block, overlap):
    """With wide overlaps several blocks of a row may reach around, not the last one only."""
    laid = set()
    for spot in spots((block, side), "torus", block, overlap, torch.device("cpu")):
        if spot.overlaps[0] == 0:
            row = spot.positions[:block].tolist()
            assert (spot.overlaps[1] > 0, spot.overlaps[3] > 0) == (row[0] in laid, row[-1] in laid)
            laid |= set(row)
    assert laid == set(range(side))


@pytest.mark.parametrize("sample", ["sample:brick", "sample:pebbles"])
def test_outputs_tile(sample):
    exemplar = ts.read_image(sample).mean(0, keepdim=True)
    result = ts.synthesize(exemplar, (100, 90), ts.recipes.quilting(block=24, boundary="torus"), seed=[1, 2])
    assert ts.metrics.seam_ratio(result.image).max() < 1.5


def test_costs_are_those_of_the_overlaps(make_exemplar):
    exemplar = make_exemplar(1)
    result = ts.synthesize(exemplar, (6, 11), ts.recipes.quilting(block=6, overlap=1), seed=1)
    assert (result.cost[0, :, :5] == 0).all()
    (one,) = result.cost[0, :, 6:].unique().tolist()
    row, column = result.source[0, :, 0, 10].tolist()
    left = result.source[0, 1, 0, 0] + 5
    first = result.source[0, 0, 0, 0]
    overlap = (exemplar[0, row : row + 6, column - 5] - exemplar[0, first : first + 6, left]).double()
    assert one == pytest.approx(float(overlap.square().mean()), abs=1e-7)


def test_a_perfect_match_leaves_a_choice_or_not():
    exemplar = ts.read_image("sample:grass")
    ragged = ts.recipes.quilting(block=18, verbatim=True)
    free = ts.recipes.quilting(block=18)
    seams = [ts.synthesize(exemplar, (90, 90), one, seed=2).seams().double().mean() for one in (ragged, free)]
    assert seams[0] < 0.9 * seams[1]


def test_progress_is_told_and_cancels(make_exemplar):
    told = []

    def progress(level, sweep, done, total, preview):
        told.append((level, sweep, done, total, preview().shape))
        if len(told) == 9:
            raise KeyboardInterrupt

    target = ts.Controls(target=make_exemplar(1, 12, 12))
    recipe = ts.recipes.quilting_transfer(block=8, passes=2)
    with pytest.raises(KeyboardInterrupt):
        ts.synthesize(make_exemplar(1), (12, 12), recipe, controls=target, seed=[1, 2], progress=progress)
    told.clear()
    ts.synthesize(
        make_exemplar(1),
        (12, 12),
        recipe,
        controls=target,
        seed=[1],
        progress=lambda *one: told.append(one[:4]),
    )
    assert told[0] == (0, 0, 0, 288)
    assert told[-1] == (0, 1, 288, 288)
    assert [one[2] for one in told] == sorted(one[2] for one in told)


def test_blocks_get_smaller_by_a_third():
    assert ts.Quilting(block=36, passes=4).sides() == ((36, 6), (24, 4), (16, 3), (11, 2))
    assert ts.recipes.with_target(ts.recipes.quilting(block=30)).patches.passes == 3
    assert ts.recipes.with_target(ts.recipes.quilting_transfer(), passes=2).patches.passes == 2


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"block": 2}, "greater than or equal to 3"),
        ({"overlap": 0}, "greater than or equal to 1"),
        ({"overlap": 18}, "overlap by less than half their side, but 18 is too much for 36"),
        ({"tolerance": -0.1}, "greater than or equal to 0"),
        ({"tolerance": float("nan")}, "finite number"),
        ({"passes": 9}, "in the last of 9 passes they are down to 1"),
        ({"blok": 3}, "Extra inputs"),
    ],
)
def test_wrong_values_are_refused(values, message):
    with pytest.raises(ValidationError, match=message):
        ts.Quilting(**values)


QUILT = ts.recipes.quilting(block=8)
FOLLOWING = ts.recipes.quilting_transfer(block=8)
PICTURE = torch.rand(1, 16, 16)
HOLE = torch.zeros(16, 16, dtype=torch.bool)
HOLE[3:6, 3:6] = True


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ts.synthesize(torch.rand(1, 7, 20), (9, 9), QUILT), "exemplar: must hold a block of 8x8, but it is only 7x20"),
        (
            lambda: ts.synthesize(PICTURE, (7, 30), QUILT.changed(boundary="torus")),
            "size: must hold a block of 8x8 if the output is to tile, but it is 7x30",
        ),
        (
            lambda: ts.synthesize(ts.Exemplar(PICTURE, torch.eye(16) > 0), (9, 9), QUILT),
            "what may be sampled: must hold a whole block of 8x8, but none lies inside it",
        ),
        (lambda: ts.synthesize(PICTURE, (9, 9), FOLLOWING), "target: must be given to the recipe 'quilting_transfer'"),
        (
            lambda: ts.synthesize(PICTURE, (9, 9), FOLLOWING, controls=ts.Controls(target=PICTURE)),
            r"target: must have the output's channels, height and width \(1, 9, 9\)",
        ),
        (
            lambda: ts.synthesize(PICTURE, (16, 16), QUILT, controls=ts.Controls(target=PICTURE)),
            r"target: must be given to a recipe that follows one, .* use torchsynth.recipes.quilting_transfer",
        ),
        (lambda: ts.synthesize(PICTURE, (16, 16), QUILT, controls=ts.Controls(PICTURE)), "initial: must be given to a"),
        (lambda: ts.synthesize(PICTURE, (16, 16), QUILT, controls=ts.Controls(angle=3.0)), "angle and scale: must be"),
        (lambda: ts.fill(PICTURE, HOLE, recipe=QUILT), "hole: must be filled by a recipe that goes pixel by pixel"),
        (lambda: ts.extend(PICTURE, (20, 20), recipe=QUILT), "hole: must be filled by a recipe that goes pixel"),
        (lambda: ts.tile(PICTURE, recipe=QUILT), "hole: must be filled by a recipe that goes pixel by pixel"),
        (lambda: ts.train(PICTURE, QUILT), "recipe: must search with trees to be trained, but 'quilting' has no"),
        (
            lambda: ts.synthesize(PICTURE, (9, 9), QUILT, codebook=ts.train(PICTURE, ts.recipes.wei_levoy_tsvq(levels=1))),
            "codebook: must be given to a recipe that searches with trees",
        ),
        (lambda: ts.analogy(PICTURE, PICTURE, PICTURE, recipe=QUILT), "guide: must be given to a recipe that compares"),
        (lambda: ts.synthesize(PICTURE, (10**6, 10**6), QUILT), "size: must fit the"),
    ],
)  # fmt: skip
def test_bad_input_is_told_before_the_work(call, message):
    with pytest.raises(ts.InputError, match=message):
        call()


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"levels": 2}, "patches are copied on one level, but there are 2"),
        ({"sweeps": ts.recipes.wei_levoy_single().sweeps}, "sweeps or patches, but this one has both"),
        ({"patches": None}, "sweeps or patches, but this one has neither"),
        ({"initial": ts.RandomSource()}, "whatever an output starts from, but there is an 'initial'"),
    ],
)
def test_recipes_that_do_not_fit_together(fields, message):
    with pytest.raises(ValidationError, match=message):
        QUILT.changed(**fields)


def test_channels_by_themselves_and_blurred_seams(make_exemplar):
    exemplar = make_exemplar(3)
    separate = ts.synthesize(exemplar, (20, 20), QUILT.changed(channels="separate"), seed=1)
    single = ts.synthesize(exemplar[1:2], (20, 20), QUILT, seed=1)
    assert separate.image[:, 1:2].equal(single.image)
    sharp = ts.synthesize(exemplar, (20, 20), QUILT, seed=1)
    soft = ts.synthesize(exemplar, (20, 20), QUILT.changed(blur_seams=3), seed=1)
    changed = (sharp.image != soft.image).any(1)
    assert changed.any()
    assert not changed.all()


def test_a_quilt_may_be_the_structure_of_another_recipe(make_exemplar):
    improved = ts.recipes.improved_wl(levels=2, neighborhood=5, parent=3)
    quilt = ts.recipes.quilting(block=8, boundary=improved.boundary)
    recipe = improved.changed(structure=improved.structure.model_copy(update={"recipe": quilt}))
    told = []
    result = ts.synthesize(make_exemplar(1), (20, 20), recipe, progress=lambda *one: told.append(one[2:4]))
    assert result.structure.recipe == quilt
    # The quilt, and of the output all rows but the last two, then these and the first two.
    assert told[0] == (0, 400 + 18 * 20 + 4 * 20)
    assert told[-1] == (840, 840)
    assert config.parse_recipe(yaml.safe_load(ts.dump_recipe(recipe)), "x") == recipe


def test_what_outputs_take_at_once_is_bounded(make_exemplar, monkeypatch):
    """Outputs are compared some at a time, also where each has an exemplar of its own."""
    exemplars = torch.stack([make_exemplar(2, seed=one) for one in range(5)])
    free = ts.synthesize(exemplars, (14, 15), QUILT, seed=1)
    monkeypatch.setattr(matching, "MEMORY_BUDGET", 2 * matching.matching_bytes((16, 16), 2))
    sizes = []
    costs = Matcher.costs

    def counted(self, queries, outputs):
        found = costs(self, queries, outputs)
        sizes.append(len(found))
        return found

    monkeypatch.setattr(Matcher, "costs", counted)
    bounded = ts.synthesize(exemplars, (14, 15), QUILT, seed=1)
    assert bounded.source.equal(free.source)
    assert max(sizes) == 2


def test_on_the_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    options = ["--recipe", "quilting", "--set", "block=12", "--set", "boundary=torus", "--size", "40x50"]
    target = ["--recipe", "quilting", "--set", "block=12", "--target", "a.png"]
    for command in (
        [
            "synthesize",
            "sample:brick",
            "-o",
            "a.png",
            *options,
            "--figure",
            "patches=b.png",
            "--levels-dir",
            "levels",
        ],
        ["rerun", "a.json", "-o", "c.png"],
        ["synthesize", "sample:grass", "-o", "t.png", *target],
    ):
        assert cli.main(command) == 0
    assert capsys.readouterr().err == ""
    assert Path("a.png").read_bytes() == Path("c.png").read_bytes()
    assert ts.read_image("b.png").shape == ts.read_image("t.png").expand(3, -1, -1).shape == (3, 40, 50)
    assert ts.read_image("levels/level-0-start.png").max() == 0
    recipe = json.loads(Path("t.json").read_text())["recipe"]
    assert recipe["patches"]["passes"] == 3
    assert "sweeps" not in recipe
    assert cli.main(["synthesize", "sample:brick", "-o", "d.png", *options, "--set", "patches.blok=3"]) == 2
    assert "did you mean 'block'?" in capsys.readouterr().err
    assert cli.main(["synthesize", "sample:grass", "-o", "d.png", *target, "--passes", "9"]) == 2
    assert capsys.readouterr().err == (
        "error: passes: must suit the recipe: blocks have a side of 3 pixels or more, but in the last of 9 passes "
        "they are down to 0; ask for fewer, or larger blocks\n"
    )
