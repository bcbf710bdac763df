"""The improved Wei-Levoy algorithm and image analogies: against their literal algorithms, and their laws."""

from __future__ import annotations

import inspect

import pytest
import torch

import torchsynth as ts
from tests.reference import analogy as literal_analogy
from tests.reference import improved_wei_levoy
from torchsynth.analogy import label_channels
from torchsynth.morphology import chosen, widened
from torchsynth.search import exhaustive


def _noise(seed, channels, size):
    generator = torch.Generator().manual_seed(seed)
    return torch.rand(channels, *size, generator=generator, dtype=torch.float64)


def _sources(result):
    return result.source[0].permute(1, 2, 0).tolist()


@pytest.mark.parametrize("boundary", ["torus", "open"])
@pytest.mark.parametrize(("weighting", "noncausal"), [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize(
    ("channels", "exemplar", "size", "levels", "causal", "parent"),
    [
        (1, (14, 15), (11, 9), 2, 3, 3),
        (2, (13, 14), (6, 10), 2, 5, 3),
        (1, (17, 18), (13, 10), 3, 3, 3),
        (1, (14, 14), (3, 8), 2, 3, 3),
    ],
)
def test_weighting_and_noncausal_passes_equal_the_paper(
    make_exemplar, channels, exemplar, size, levels, causal, parent, weighting, noncausal, boundary
):
    sample = make_exemplar(channels, *exemplar, seed=3, dtype=torch.float64)
    recipe = ts.recipes.improved_wl(
        weighting=weighting, noncausal=noncausal, morphology=False, levels=levels, neighborhood=causal,
        parent=parent, boundary=boundary,
    )  # fmt: skip
    result = ts.synthesize(sample, size, recipe, seed=11)
    # What a pixel that has nothing to go by takes at random is seen before the last pass replaces it.
    begun = recipe.changed(sweeps=recipe.sweeps[:-1]) if noncausal else recipe
    lonely = ts.synthesize(sample, size, begun, seed=11).levels[-1].source[0, :, 0, 0]
    literal = improved_wei_levoy.synthesize(
        sample, _noise(11, channels, size), levels, causal, parent, weighting, noncausal, boundary == "torus",
        tuple(lonely.tolist()),
    )  # fmt: skip
    assert _sources(result) == literal.tolist()


@pytest.mark.parametrize(("operation", "size"), [("erode", 3), ("dilate", 5)])
def test_all_three_equal_the_paper(make_exemplar, operation, size):
    sample = make_exemplar(1, 15, 14, seed=4, dtype=torch.float64)
    recipe = ts.recipes.improved_wl(levels=2, neighborhood=3, parent=3, operation=operation, size=size)
    result = ts.synthesize(sample, (9, 11), recipe, seed=8)
    literal, structure = literal_analogy.improved(
        sample.numpy(), _noise(8, 1, (9, 11)), 2, 3, 3, True, True,
        operation={"erode": "erosion", "dilate": "dilation"}[operation], size=size, neighborhood=3, guide=3,
    )  # fmt: skip
    assert _sources(result.structure) == structure.tolist()
    assert _sources(result) == literal.tolist()
    assert result.recipe.structure.operation == operation


@pytest.mark.parametrize("boundary", ["torus", "open"])
@pytest.mark.parametrize("kappa", [0.0, 0.7, 20.0])
@pytest.mark.parametrize(
    ("guides", "channels", "exemplar", "size", "levels", "guide", "coarse_guide"),
    [
        (1, 1, (12, 13), (9, 10), 1, 3, None),
        (2, 1, (14, 13), (7, 11), 2, 3, 3),
        (1, 3, (14, 14), (10, 9), 2, 5, None),
        (3, 2, (13, 15), (8, 8), 2, 1, 1),
    ],
)
def test_analogies_equal_the_paper(
    make_exemplar, guides, channels, exemplar, size, levels, guide, coarse_guide, kappa, boundary
):
    a = make_exemplar(guides, *exemplar, seed=1, dtype=torch.float64)
    a_prime = make_exemplar(channels, *exemplar, seed=2, dtype=torch.float64)
    b = make_exemplar(guides, *size, seed=5, dtype=torch.float64)
    recipe = ts.recipes.analogy(
        levels=levels, neighborhood=3, parent=3, guide=guide, coarse_guide=coarse_guide, kappa=kappa,
        boundary=boundary,
    )  # fmt: skip
    result = ts.analogy(a, a_prime, b, recipe, seed=6)
    literal = literal_analogy.synthesize(
        a, a_prime, b, _noise(6, channels, size), levels, 3, 3, guide, coarse_guide, boundary == "torus",
        kappa or None,
    )  # fmt: skip
    assert _sources(result) == literal.tolist()
    assert result.image.equal(result.transfer(a_prime))


@pytest.mark.parametrize("search", ["exhaustive", "tsvq", "coherence"])
def test_outputs_do_not_depend_on_their_batch(make_exemplar, search):
    a, b = make_exemplar(2, 16, 17, seed=1), make_exemplar(2, 12, 9, seed=2)
    recipe = ts.recipes.analogy(levels=2, neighborhood=3, search=search, boundary="torus")
    a_prime = make_exemplar(3, 16, 17, seed=3)
    together = ts.analogy(a, a_prime, b, recipe, seed=[5, 9])
    for number, seed in enumerate((5, 9)):
        alone = ts.analogy(a, a_prime, b, recipe, seed=seed)
        assert alone.image[0].equal(together.image[number])
        assert alone.source[0].equal(together.source[number])


def test_each_output_may_have_a_guide_and_an_exemplar_of_its_own(make_exemplar):
    images = torch.stack([make_exemplar(1, 14, 14, seed=seed) for seed in (1, 2)])
    guides = torch.stack([make_exemplar(2, 14, 14, seed=seed) for seed in (3, 4)])
    upon = torch.stack([make_exemplar(2, 9, 8, seed=seed) for seed in (5, 6)])
    recipe = ts.recipes.analogy(levels=1, neighborhood=3, guide=3)
    both = ts.synthesize(
        ts.Exemplar(images, guide=guides), (9, 8), recipe, controls=ts.Controls(guide=upon), seed=[1, 2]
    )
    for number in range(2):
        alone = ts.synthesize(
            ts.Exemplar(images[number], guide=guides[number]), (9, 8), recipe,
            controls=ts.Controls(guide=upon[number]), seed=number + 1,
        )  # fmt: skip
        assert alone.image[0].equal(both.image[number])


def test_a_picture_analogous_to_itself_is_its_filtered_self(make_exemplar):
    a = make_exemplar(1, 24, 24, seed=3)
    a_prime = 1 - a
    result = ts.analogy(a, a_prime, a, ts.recipes.analogy(levels=1, guide=5))
    assert result.image[0, :, 4:-4, 4:-4].equal(a_prime[:, 4:-4, 4:-4])


def test_each_channel_may_be_made_by_itself(make_exemplar):
    a, b = make_exemplar(1, 16, 16, seed=1), make_exemplar(1, 8, 8, seed=2)
    recipe = ts.recipes.analogy(levels=1, neighborhood=3, guide=3).changed(channels="separate")
    a_prime = make_exemplar(2, 16, 16, seed=3)
    result = ts.analogy(a, a_prime, b, recipe)
    assert result.image[:, 1:].equal(ts.analogy(a, a_prime[1:], b, recipe).image)


def test_labels_paint_by_numbers():
    a = torch.zeros(20, 20, dtype=torch.long)
    a[:, 10:] = 7
    a_prime = torch.rand(1, 20, 20, generator=torch.Generator().manual_seed(1)) / 3
    a_prime[..., 10:] += 0.6
    b = torch.zeros(12, 14, dtype=torch.long)
    b[6:] = 7
    recipe = ts.recipes.analogy(levels=1, neighborhood=3, guide=1, guide_weight=100)
    result = ts.analogy(a, a_prime, b, recipe)
    assert (result.image[0, 0] > 0.5).equal(b == 7)


def test_colors_as_labels_are_all_equally_far_apart():
    a = torch.tensor([[[0.1, 0.2, 0.9]]])
    guides, upon = label_channels(a, a.flip(2))
    assert guides.flatten(1).T.tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    assert upon.equal(guides.flip(2))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"a": torch.rand(1, 16, 15)}, "A: must have the height and width of A', (16, 16), but its shape is (1, 16, 15)"),
        ({"b": torch.rand(3, 9, 9)}, "B: must have the 1 channel(s) of A, but it has 3"),
        ({"b": torch.zeros(9, 9, dtype=torch.long)}, "A and B: must both be pictures, or both be maps"),
        ({"a": torch.rand(1, 16, 16) * 2}, "A: values must lie in [0, 1]"),
        ({"recipe": ts.recipes.wei_levoy()}, "guide: must be given to a recipe that compares it"),
        ({"labels": True}, "A: a map must have at most 64 labels, but it has 256 colors"),
        ({"a_prime": torch.rand(1, 3, 3), "a": torch.rand(1, 3, 3)}, "exemplar: the 5x5 result + 5x5 guide neighborhood must fit"),
    ],
)  # fmt: skip
def test_wrong_pictures_are_told(change, message):
    given = {"a": torch.rand(1, 16, 16), "a_prime": torch.rand(2, 16, 16), "b": torch.rand(1, 9, 9)} | change
    with pytest.raises(ts.InputError) as error:
        ts.analogy(**given)
    assert str(error.value).startswith(message)


def test_a_search_that_does_not_exist_is_told():
    unchecked = inspect.unwrap(ts.recipes.analogy)  # where types are not checked, as outside of tests
    with pytest.raises(
        ts.ConfigError, match="search: must be one of exhaustive, tsvq, coherence, but it is 'tsv'"
    ):
        unchecked(search="tsv")


def test_labels_that_a_never_shows_are_told():
    a, b = torch.zeros(8, 8, dtype=torch.uint8), torch.zeros(4, 4, dtype=torch.uint8)
    b[0, :3] = 9
    with pytest.raises(
        ts.InputError, match=r"B: must show labels of A only, but 3 of its .* have the label \(9\)"
    ):
        ts.analogy(a, torch.rand(1, 8, 8), b)


def test_guides_come_in_pairs(make_exemplar):
    sample, guide = make_exemplar(1, 12, 12), make_exemplar(2, 12, 12)
    recipe = ts.recipes.analogy(levels=1, neighborhood=3)
    with pytest.raises(ts.InputError, match="the output has none"):
        ts.synthesize(ts.Exemplar(sample, guide=guide), (6, 6), recipe)
    with pytest.raises(ts.InputError, match="the exemplar has none"):
        ts.synthesize(sample, (6, 6), recipe, controls=ts.Controls(guide=guide[:, :6, :6]))
    with pytest.raises(
        ts.InputError, match=r"guide: must have the output's channels, height and width \(2, 6, 6\)"
    ):
        ts.synthesize(ts.Exemplar(sample, guide=guide), (6, 6), recipe, controls=ts.Controls(guide=guide))
    with pytest.raises(ts.InputError, match="must lie upon the exemplar"):
        ts.train(sample, ts.recipes.analogy(levels=1, search="tsvq"))


def test_trees_of_analogies_can_be_kept(make_exemplar):
    exemplar = ts.Exemplar(make_exemplar(1, 20, 20), guide=make_exemplar(2, 20, 20, seed=4))
    controls = ts.Controls(guide=make_exemplar(2, 8, 9, seed=5))
    recipe = ts.recipes.analogy(levels=2, neighborhood=3, guide=3, search="tsvq", kappa=1.0)
    codebook = ts.train(exemplar, recipe)
    kept = ts.synthesize(exemplar, (8, 9), recipe, controls=controls, codebook=codebook)
    assert kept.image.equal(ts.synthesize(exemplar, (8, 9), recipe, controls=controls).image)
    other = ts.Exemplar(exemplar.image, guide=1 - exemplar.guide)
    with pytest.raises(ts.InputError, match="must have been trained on this exemplar"):
        ts.synthesize(other, (8, 9), recipe, controls=controls, codebook=codebook)


def test_trees_of_stretched_levels_are_others(make_exemplar):
    plain = ts.recipes.wei_levoy_tsvq(levels=2, neighborhood=3, parent=3)
    codebook = ts.train(make_exemplar(1, 20, 20), plain)
    wide = plain.changed(dynamic_range="finest")
    with pytest.raises(ts.InputError, match="its 'dynamic_range' is own, not finest"):
        ts.synthesize(make_exemplar(1, 20, 20), (6, 6), wide, codebook=codebook)


@pytest.mark.parametrize("boundary", ["torus", "open"])
def test_holes_and_targets_are_stretched_like_the_exemplar(make_exemplar, boundary):
    sample = make_exemplar(1, 40, 40, seed=2)
    recipe = ts.recipes.improved_wl(morphology=False, levels=2, neighborhood=5, parent=3, boundary=boundary)
    hole = torch.zeros(40, 40, dtype=torch.bool)
    hole[3:6, 3:6] = True
    bordered = ts.recipes.improved_wl(morphology=False, levels=2, neighborhood=5, parent=3, boundary="open")
    filled = ts.fill(sample, hole, recipe=bordered)
    assert filled.image[0][:, ~hole].equal(sample[:, ~hole])
    # The known part of the coarse level is the exemplar's, so it has sources.
    known = filled.levels[1].source[0, 0] >= 0
    assert bool(known.all())
    followed = ts.recipes.with_target(recipe)
    result = ts.synthesize(sample, (40, 40), followed, controls=ts.Controls(target=sample))
    assert result.image.equal(result.transfer(sample))


@pytest.mark.parametrize("background", [0.2, 0.8])
def test_joints_are_recognized(background):
    picture = torch.full((1, 1, 48, 48), background) + torch.rand(1, 1, 48, 48) * 0.1
    joints = torch.rand(1, 1, 48, 48) * 0.1 + (0.05 if background > 0.5 else 0.85)
    lines = torch.zeros(48, 48, dtype=torch.bool)
    lines[::12] = lines[:, ::12] = True
    picture = torch.where(lines, joints, picture)
    operation, size, share = chosen(picture, None, None)
    assert operation == ("erode" if background > 0.5 else "dilate")
    assert 1 / 4 <= share < 2 / 3
    result = ts.synthesize(picture[0], (32, 32), ts.recipes.improved_wl(levels=2, neighborhood=5, parent=3))
    structure = result.recipe.structure
    assert (structure.operation, structure.size) == (operation, size)
    wide = widened(picture, operation, size)
    assert result.structure.levels[0].exemplar.equal(wide)


@pytest.mark.parametrize("width", [1, 2, 4])
def test_joints_are_recognized_between_grainy_stones(width):
    """Grain makes holes in the stones, while joints are wide where they meet."""
    place = torch.arange(96) % 24
    joint, corner = place < width, place < 6
    dark = joint | joint.unsqueeze(1) | (corner & corner.unsqueeze(1))
    picture = torch.where(dark, 0.2, 0.7).view(1, 1, 96, 96)
    grainy = (picture + 0.2 * torch.randn(1, 1, 96, 96)).clamp(0, 1)
    assert chosen(grainy, None, None)[0] == "erode"
    assert chosen(1 - grainy, None, None)[0] == "dilate"


def test_what_cannot_be_sampled_does_not_widen():
    picture = torch.rand(1, 1, 12, 12, generator=torch.Generator().manual_seed(3))
    valid = torch.ones(12, 12, dtype=torch.bool)
    valid[:, 6:] = False
    spoilt = picture.masked_fill(~valid, 0.0)
    for operation in ("erode", "dilate"):
        assert widened(picture, operation, 5, valid)[..., :6].equal(
            widened(spoilt, operation, 5, valid)[..., :6]
        )
    assert chosen(picture, None, None, valid) == chosen(spoilt, None, None, valid)


@pytest.mark.parametrize(
    ("control", "subject"),
    [
        ({"initial": torch.rand(1, 16, 16), "hole": torch.eye(16) > 0}, "hole"),
        ({"guide": torch.rand(1, 16, 16)}, "guide"),
        ({"target": torch.rand(1, 16, 16)}, "target"),
    ],
)
def test_a_recipe_with_a_structure_takes_no_other_guide(make_exemplar, control, subject):
    recipe = ts.recipes.improved_wl(levels=1, neighborhood=3)
    with pytest.raises(ts.InputError, match=rf"^{subject}: "):
        ts.synthesize(make_exemplar(1, 16, 16), (16, 16), recipe, controls=ts.Controls(**control))


def test_a_structure_is_turned_like_the_output(make_exemplar):
    recipe = ts.recipes.improved_wl(levels=1, neighborhood=3)
    result = ts.synthesize(make_exemplar(1, 16, 16), (9, 9), recipe, controls=ts.Controls(angle=30.0))
    assert result.distorted
    assert result.structure.distorted
    assert result.image.equal(result.transfer(make_exemplar(1, 16, 16)))


def test_progress_counts_structure_and_output_together(make_exemplar):
    seen = []

    def watch(level, sweep, done, total, preview):  # noqa: ARG001 (the signature of Progress)
        seen.append((done, total))

    recipe = ts.recipes.improved_wl(levels=2, neighborhood=3, parent=3)
    ts.synthesize(make_exemplar(1, 16, 16), (8, 8), recipe, progress=watch)
    assert seen[-1][0] == seen[-1][1] == (7 + 2 + 8) * 8 + (3 + 2 + 4) * 4 + (7 + 2) * 8
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)


@pytest.mark.parametrize("separate", ["structure", "output"])
def test_progress_counts_each_channel_that_is_made_by_itself(make_exemplar, separate):
    recipe = ts.recipes.improved_wl(levels=1, neighborhood=3, noncausal=False)
    one = recipe.changed(channels="separate")
    if separate == "structure":
        inner = recipe.structure.recipe.changed(channels="separate")
        one = recipe.changed(structure=recipe.structure.model_copy(update={"recipe": inner}))
    seen = []
    ts.synthesize(make_exemplar(2), (5, 6), one, progress=lambda *told: seen.append(told[2:4]))
    assert seen[-1] == (90, 90)
    assert seen == sorted(seen)


def test_a_batch_of_exemplars_chooses_for_each():
    dark = torch.full((1, 24, 24), 0.9)
    dark[:, ::8] = 0.1
    both = torch.stack((dark, 1 - dark))
    recipe = ts.recipes.improved_wl(levels=1, neighborhood=5)
    result = ts.synthesize(both, (10, 10), recipe, seed=[3, 4])
    for number, seed in enumerate((3, 4)):
        alone = ts.synthesize(both[number], (10, 10), recipe, seed=seed)
        assert alone.image[0].equal(result.image[number])
        assert alone.structure.image[0].equal(result.structure.image[number])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sweeps": ts.recipes.wei_levoy_single().sweeps}, "no sweep has a layer on a guide plane"),
        (
            {"structure": ts.Structure(recipe=ts.recipes.wei_levoy(boundary="open"))},
            "a structure must have the recipe's boundary",
        ),
        (
            {"structure": ts.Structure(recipe=ts.recipes.analogy(boundary="torus"))},
            "a structure is made without guide or target",
        ),
    ],
)
def test_structures_that_make_no_sense_are_told(change, message):
    with pytest.raises(ValueError, match=message):
        ts.recipes.improved_wl().changed(**change)


def test_even_structuring_elements_are_told():
    with pytest.raises(ValueError, match="a side must be odd, but 4 is even"):
        ts.recipes.improved_wl(size=4)


def test_a_preference_needs_sources():
    with pytest.raises(ValueError, match="leaves propose centroids"):
        ts.PreferCoherent(best=ts.TSVQ(leaf="centroid"), template=ts.Causal(size=3), kappa=1.0)


def test_a_recipe_with_a_structure_follows_no_target():
    with pytest.raises(ts.ConfigError, match="improved_wl: must have no structure to follow a target"):
        ts.recipes.with_target(ts.recipes.improved_wl())


def test_a_structure_gets_the_boundary_of_its_recipe():
    recipe = ts.recipes.improved_wl(boundary="torus", noncausal=False).changed(boundary="open")
    assert recipe == ts.recipes.improved_wl(boundary="open", noncausal=False)


def test_parameters_of_a_recipe_with_a_structure_reach_it():
    assert ts.load_recipe("improved_wl", ["levels=2", "size=5"]) == ts.recipes.improved_wl(levels=2, size=5)


def test_many_equally_good_candidates_are_not_sifted_one_by_one(make_exemplar, monkeypatch):
    """Of a map of two labels half of all candidates are equally good: that took minutes."""
    computed = []
    exact = exhaustive._exact_costs
    monkeypatch.setattr(exhaustive, "_exact_costs", lambda *given: computed.append(1) or exact(*given))
    a = torch.zeros(24, 24, dtype=torch.uint8)
    a[:, 12:] = 1
    a_prime = make_exemplar(1, 24, 24)
    recipe = ts.recipes.analogy(levels=2, neighborhood=3, guide_weight=100)
    quickly = ts.analogy(a, a_prime, a[:, 6:18], recipe)
    assert computed
    monkeypatch.setattr("torchsynth.search.base.TABLE_BUDGET", 0)
    assert ts.analogy(a, a_prime, a[:, 6:18], recipe).source.equal(quickly.source)
    monkeypatch.undo()
    monkeypatch.setattr("torchsynth.search.sieve._FEW", 0)
    assert ts.analogy(a, a_prime, a[:, 6:18], recipe).source.equal(quickly.source)


def test_squares_larger_than_the_exemplar_are_told(make_exemplar):
    recipe = ts.recipes.improved_wl(levels=1, neighborhood=3, size=17)
    with pytest.raises(ts.InputError, match="a square that fits the exemplar, 16x20, but its side is 17"):
        ts.synthesize(make_exemplar(1, 16, 20), (8, 8), recipe)


@pytest.mark.parametrize("side", [10**6, 10**90])
def test_a_structure_beyond_all_memory_is_told_before_the_work(make_exemplar, side):
    with pytest.raises(ts.InputError, match=r"^size: must fit the .* of memory of this machine"):
        ts.synthesize(
            make_exemplar(1, 16, 16), (side, side), ts.recipes.improved_wl(levels=1, neighborhood=3)
        )
