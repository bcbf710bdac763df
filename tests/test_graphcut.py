"""Graph-cut textures, against a literal loop and brute force."""

from __future__ import annotations

import itertools

import pytest
import torch
from pydantic import ValidationError

import torchsynth as ts
from tests.reference import graphcut as literal
from torchsynth.neighborhood import Plane, quantize
from torchsynth.patches import graphcut as module
from torchsynth.patches import scene, seam
from torchsynth.patches.seam import NEW, OLD, Colors, Graph, Neighbors, Shown, Sources, seam_cost


def _price(graph, side):
    """What a division of the nodes cuts."""
    first, second = side[graph.ends]
    return int(graph.capacity[first != second].sum())


def _random_overlap(height, width):
    """A graph as it is built: two old patches side by side, the first column tied to them, the last to the new one."""
    sources = Sources(torch.randint(-9, 9, (2, 1200)).double(), (20, 60), torch.rand(1200) > 0.1)
    grid = torch.arange(height * width).view(height, width)
    rows, columns = grid // width, grid % width
    place = torch.where(
        columns < width // 2 + rows % 2, rows * 60 + columns, (rows + 4) * 60 + columns + 3
    ).flatten()
    shown = Shown(sources.colors[:, place], place)
    node = (grid - grid // width * 2 + 1).flatten()
    node = torch.where(columns.flatten() == 0, OLD, torch.where(columns.flatten() == width - 1, NEW, node))
    pairs = [
        Neighbors(0, grid[:-1].flatten(), grid[1:].flatten()),
        Neighbors(1, grid[:, :-1].flatten(), grid[:, 1:].flatten()),
    ]
    return Graph.of(node, pairs, shown, torch.randint(-9, 9, (2, height * width)).double(), sources)


def _without_direct(graph):
    """The graph without what is cut in any case: arcs between the two ends."""
    between = graph.ends.sum(0) != OLD + NEW
    return Graph(graph.nodes, graph.ends[:, between], graph.capacity[between])


@pytest.mark.parametrize("seed", range(8))
def test_a_cut_is_the_cheapest_of_all(seed):
    torch.manual_seed(seed)
    graph = _without_direct(_random_overlap(2, 5))
    assert graph.nodes > 2 + 6  # old seams have nodes
    side, cost = graph.cut()
    assert _price(graph, side) == cost
    prices = {}
    for chosen in itertools.product((False, True), repeat=graph.nodes - 2):
        prices[chosen] = _price(graph, torch.tensor([False, True, *chosen]))
    assert cost == min(prices.values())
    # Of several, the one with the fewest nodes on the new side.
    found = tuple(side[2:].tolist())
    assert all(sum(found) <= sum(one) for one, price in prices.items() if price == cost)


def test_a_large_cut_costs_what_flows():
    graph = _without_direct(_random_overlap(8, 40))
    side, cost = graph.cut()
    assert not side[OLD]
    assert side[NEW]
    assert _price(graph, side) == cost
    assert cost > 0


def test_capacities_are_made_to_fit_what_can_be_counted(monkeypatch):
    graph = _without_direct(_random_overlap(6, 9))
    _, cost = graph.cut()
    monkeypatch.setattr(seam, "_MOST", 2**7 - 1)
    side, coarse = graph.cut()
    assert coarse < 2**7 <= cost
    assert _price(graph, side) < 1.5 * cost


def test_an_old_seam_is_paid_for_or_covered():
    """Between two pixels of different patches: keeping the seam, or paying at one of them."""
    colors = torch.tensor([[0.0, 0.0, 100.0, 100.0]]).double()
    sources = Sources(colors, (1, 4), torch.ones(4, dtype=torch.bool))
    shown = Shown(colors[:, [0, 3]], torch.tensor([0, 3]))
    pairs = [Neighbors(1, torch.tensor([0]), torch.tensor([1]))]
    one, other, broken = shown.patches(pairs[0], sources)
    assert broken.tolist() == [True]
    assert (one.second.tolist(), other.first.tolist()) == ([[0.0]], [[100.0]])
    for new, covered in ((0.0, 1), (5000.0, 0)):
        graph = Graph.of(torch.tensor([OLD, 2]), pairs, shown, torch.full((1, 2), new).double(), sources)
        side, cost = graph.cut()
        assert side[2:].sum() == 2 * covered
        assert cost == (1 if covered else int(seam_cost(one, other)))


def test_seams_hide_in_edges():
    def cost(step):
        flat = torch.zeros(1, 1).double()
        return int(seam_cost(Colors(flat, flat + step), Colors(flat + 8, flat + step + 8)))

    assert cost(0) == 64 * 16
    assert cost(50) == round(64 * 16 / 201)


def test_comparing_equals_brute_force(make_exemplar):
    exemplar = make_exemplar(2, 6, 5)
    plane = Plane(quantize(exemplar[None], torch.float32), (6, 5), "open")
    picture = plane.values[0].double().T.unflatten(1, (6, 5))
    valid = torch.rand(6, 5) > 0.3
    canvas = ts.canvas.Canvas.blank(torch.zeros(1, 2, 11, 12), exemplar[None], plane, "open")
    sources = Sources(picture.flatten(1), (6, 5), valid.flatten())
    one = scene.Scene.of(canvas, sources, scene.domain((11, 12), "open", (6, 5)))
    assert one.size == (16, 16)
    known = one.wanted & (torch.rand(256) > 0.5)
    one.shown.colors[:] = torch.randint(-128, 128, (2, 256)).double()
    patch = scene.Patch.of(picture, valid, (0, 0), (6, 5), one.size)
    costs, counts = one.compare(patch, known)
    assert counts.equal(one.count(patch, known))
    for place in range(256):
        cells = one.cells(place, (6, 5))
        both = valid & known[cells]
        expected = ((one.shown.colors[:, cells] - picture).square().sum(0) * both).sum()
        assert (costs[place], counts[place]) == (expected, both.sum())


@pytest.mark.parametrize("boundary", ["open", "torus"])
@pytest.mark.parametrize(
    ("patch", "shape", "refinements", "k", "channels"),
    [(None, (6, 6), 3, 0.05, 1), (6, (9, 8), 2, 0.01, 3), (None, (6, 6), 2, 1.0, 2)],
)
def test_it_equals_the_literal_loop(make_exemplar, boundary, patch, shape, refinements, k, channels):
    exemplar = make_exemplar(channels, *shape, seed=channels)
    valid = torch.ones(shape, dtype=torch.bool)
    valid[0, 0] = channels == 1
    size = (10, 11)
    recipe = ts.recipes.graphcut(patch=patch, k=k, refinements=refinements, boundary=boundary)
    result = ts.synthesize(ts.Exemplar(exemplar, valid), size, recipe, seed=channels)
    draws = torch.Generator().manual_seed(channels)
    source = literal.graphcut(
        (quantize(exemplar[None], torch.float64)[0].long().view(*shape, channels)).numpy(), valid.numpy(), size,
        size if boundary == "torus" else (15, 16), patch=(6, 6), overlap=0.25, k=k, refinements=refinements,
        torus=boundary == "torus", draw=_pairwise(draws),
    )  # fmt: skip
    assert result.source[0].permute(1, 2, 0).equal(torch.from_numpy(source))


def _pairwise(generator):
    """The library's random numbers, two for each patch."""
    waiting = []

    def draw():
        if not waiting:
            waiting.extend(torch.randint(2**31, (2,), generator=generator).tolist())
        return waiting.pop(0)

    return draw


def test_outputs_tile():
    exemplar = ts.read_image("sample:pebbles").mean(0, keepdim=True)[:, :64, :64]
    result = ts.synthesize(exemplar, (90, 100), ts.recipes.graphcut(boundary="torus"), seed=[1, 2])
    assert ts.metrics.seam_ratio(result.image).max() < 1.5


def test_mending_lowers_what_seams_cost(monkeypatch):
    exemplar = ts.read_image("sample:gravel").mean(0, keepdim=True)[:, :48, :48]
    costs = []
    mend = module._Collage.mend

    def measured(self):
        costs.append(int(self.scene.seams().sum()))
        mend(self)
        costs.append(int(self.scene.seams().sum()))

    monkeypatch.setattr(module._Collage, "mend", measured)
    ts.synthesize(exemplar, (100, 100), ts.recipes.graphcut(refinements=8), seed=1)
    assert len(costs) == 16
    assert costs[-1] < costs[0]


def test_patches_are_large(make_exemplar):
    """Far fewer seams than pixels, and all of the exemplar's valid part may be one patch."""
    exemplar = make_exemplar(3, 24, 24)
    valid = torch.ones(24, 24, dtype=torch.bool)
    valid[:5, :7] = False
    result = ts.synthesize(ts.Exemplar(exemplar, valid), (40, 40), ts.recipes.graphcut(), seed=1)
    assert result.seams().double().mean() < 0.25
    assert valid[result.source[0, 0], result.source[0, 1]].all()
    assert result.cost.min() == 0  # the first patch


def test_progress_is_told_and_cancels(make_exemplar):
    told = []
    ts.synthesize(
        make_exemplar(1),
        (20, 20),
        ts.recipes.graphcut(refinements=3),
        seed=[1, 2],
        progress=lambda *one: told.append(one[:4]),
    )
    assert told[0] == (0, 0, 0, 800)
    assert told[-1] == (0, 1, 800, 800)

    def cancel(_level, _sweep, done, _total, preview):
        if done:
            assert preview().shape == (1, 1, 20, 20)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ts.synthesize(make_exemplar(1), (20, 20), ts.recipes.graphcut(), progress=cancel)


def test_without_scipy_it_says_how_to_get_it(make_exemplar, monkeypatch):
    monkeypatch.setattr(seam, "find_spec", lambda _name: None)
    with pytest.raises(ts.InputError, match=r'pip install "torchsynth-textures\[graphcut\]"'):
        ts.synthesize(make_exemplar(1), (20, 20), ts.recipes.graphcut())


def test_bad_input_is_told_before_the_work(make_exemplar):
    exemplar = make_exemplar(1, 12, 20)
    with pytest.raises(ts.InputError, match="exemplar: must hold a patch of 13x13, but it is only 12x20"):
        ts.synthesize(exemplar, (20, 20), ts.recipes.graphcut(patch=13))
    with pytest.raises(ts.InputError, match="what may be sampled: must hold a whole patch of 4x4, but none"):
        ts.synthesize(ts.Exemplar(exemplar, torch.eye(12, 20) > 0), (20, 20), ts.recipes.graphcut(patch=4))
    with pytest.raises(ts.InputError, match="size: must fit the"):
        ts.synthesize(exemplar, (10**90, 10**90), ts.recipes.graphcut())
    with pytest.raises(ts.InputError, match=r"recipes\.quilting_transfer"):
        ts.synthesize(exemplar, (12, 20), ts.recipes.graphcut(), controls=ts.Controls(target=exemplar))
    with pytest.raises(ts.ConfigError, match="must be able to follow a target, but graph cuts follow none"):
        ts.recipes.with_target(ts.recipes.graphcut())


@pytest.mark.parametrize(
    "values",
    [{"patch": 2}, {"overlap": 0.0}, {"overlap": 1.0}, {"k": 0.0}, {"k": float("nan")}, {"refinements": -1}],
)
def test_wrong_values_are_refused(values):
    with pytest.raises(ValidationError, match=next(iter(values))):
        ts.GraphCut(**values)
