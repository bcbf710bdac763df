"""Modules and datasets: synthesis inside of torch pipelines."""

from __future__ import annotations

import copy
import pickle

import pytest
import safetensors.torch
import torch
from kornia.augmentation import AugmentationSequential, RandomHorizontalFlip
from torch import nn
from torch.utils.data import DataLoader

import torchsynth as ts
from torchsynth.data import TextureDataset
from torchsynth.nn import Analogy, Fill, Retexture, Synthesize

ASHIKHMIN = ts.recipes.ashikhmin(neighborhood=3)
TSVQ = ts.recipes.wei_levoy_tsvq(levels=2, neighborhood=3, parent=3, depth=3)


@pytest.fixture
def picture(make_exemplar):
    return make_exemplar(3, 24, 26)


def test_a_module_makes_what_the_function_makes(picture):
    make = Synthesize(picture, ASHIKHMIN, (9, 11))
    expected = ts.synthesize(picture, (9, 11), ASHIKHMIN, seed=[3, 8]).image
    for seeds in ([3, 8], torch.tensor([3, 8])):
        assert make(seeds).equal(expected)
    assert make(8).equal(expected[1])
    assert make(torch.tensor(3)).equal(expected[0])


def test_what_is_sampled_is_kept(picture):
    valid = torch.zeros(24, 26, dtype=torch.bool)
    valid[:, :12] = True
    make = Synthesize(ts.Exemplar(picture, valid), ASHIKHMIN, (8, 8))
    assert sorted(make.state_dict()) == ["exemplar", "valid"]
    assert make(1).equal(ts.synthesize(ts.Exemplar(picture, valid), (8, 8), ASHIKHMIN, seed=1).image[0])


def test_codebooks_are_buffers(picture, tmp_path):
    codebook = ts.train(picture, TSVQ)
    make = Synthesize(picture, TSVQ, (8, 8), codebook=codebook)
    assert make(5).equal(ts.synthesize(picture, (8, 8), TSVQ, seed=5).image[0])
    safetensors.torch.save_file(make.state_dict(), tmp_path / "module.safetensors")
    other = make_other = torch.rand(3, 24, 26, generator=torch.Generator().manual_seed(9))
    again = Synthesize(make_other, TSVQ, (8, 8), codebook=ts.train(other, TSVQ))
    assert not again(5).equal(make(5))
    again.load_state_dict(safetensors.torch.load_file(tmp_path / "module.safetensors"))
    assert again.codebook.exemplar == codebook.exemplar
    assert again(5).equal(make(5))


def test_a_codebook_of_another_exemplar_is_refused(picture):
    make = Synthesize(picture, TSVQ, (8, 8), codebook=ts.train(1 - picture, TSVQ))
    with pytest.raises(ts.InputError, match="must have been trained on this exemplar"):
        make(0)


def test_modules_are_copied_pickled_and_moved(picture):
    make = Synthesize(picture, ASHIKHMIN, (8, 8))
    assert pickle.loads(pickle.dumps(make))(1).equal(make(1))  # noqa: S301 (made here)
    double = copy.deepcopy(make).to(torch.float64)
    assert double(1).dtype == torch.float64
    assert double(1).equal(make(1).double())


def test_holes_are_marked_by_nan_or_by_the_module(picture):
    hole = torch.zeros(24, 26, dtype=torch.bool)
    hole[5:9, 6:9] = True
    expected = ts.fill(picture, hole, seed=2).image[0]
    broken = picture.masked_fill(hole, torch.nan)
    assert Fill(seed=2)(broken).equal(expected)
    assert Fill(hole=hole, seed=2)(picture).equal(expected)
    both = torch.stack((picture, broken))
    filled = Fill(seed=1)(both)
    assert filled[0].equal(picture)
    assert filled[1].equal(expected)
    assert Fill()(picture).equal(picture)


def test_a_batch_of_analogies_is_one_by_one(make_exemplar):
    a, b = make_exemplar(1, 20, 20), make_exemplar(1, 9, 10, seed=3)
    recipe = ts.recipes.analogy(levels=1, neighborhood=3)
    carry = Analogy(a, 1 - a, recipe, seed=4)
    made = carry(torch.stack((b, 1 - b)))
    assert made[0].equal(ts.analogy(a, 1 - a, b, recipe, seed=4).image[0])
    assert made[1].equal(ts.analogy(a, 1 - a, 1 - b, recipe, seed=5).image[0])
    assert carry(b).equal(made[0])
    with pytest.raises(ts.InputError, match="A: must have the height and width of A'"):
        Analogy(a, b)


def test_modules_follow_each_other(make_exemplar):
    a = make_exemplar(1, 20, 20)
    recipe = ts.recipes.analogy(levels=1, neighborhood=3)
    pipeline = nn.Sequential(Synthesize(a, ASHIKHMIN, (9, 9)), Analogy(a, 1 - a, recipe))
    assert pipeline(torch.tensor([1, 2])).shape == (2, 1, 9, 9)
    transforms = [Fill(), Analogy(a, 1 - a, recipe), nn.Identity()]
    image = make_exemplar(1, 9, 9)
    for transform in transforms:
        image = transform(image)
    assert image.shape == (1, 9, 9)


def test_kornia_takes_them_among_its_own(picture):
    region = torch.arange(26).expand(24, 26) < 10
    change = Retexture(picture, ASHIKHMIN, region=region)
    torch.manual_seed(3)
    made = AugmentationSequential(RandomHorizontalFlip(p=0.0), change, data_keys=["input"])(picture[None])
    assert made.shape == (1, 3, 24, 26)
    assert made[0, :, :, 10:].equal(picture[:, :, 10:])
    assert not made[0, :, :, :10].equal(picture[:, :, :10])


def test_each_call_has_new_seeds_that_torch_governs(picture):
    region = torch.ones(24, 26, dtype=torch.bool)
    change = Retexture(picture, ASHIKHMIN)
    torch.manual_seed(1)
    first, second = change(picture, region), change(picture, region)
    torch.manual_seed(1)
    assert change(picture, region).equal(first)
    assert not first.equal(second)
    fixed = Retexture(picture, ASHIKHMIN, region=region, seed=7)
    assert fixed(picture).equal(ts.synthesize(picture, (24, 26), ASHIKHMIN, seed=7).image[0])


def test_some_pictures_stay_as_they_are(picture):
    region = torch.ones(24, 26, dtype=torch.bool)
    batch = picture.expand(12, -1, -1, -1)
    made = Retexture(picture, ASHIKHMIN, region=region, p=0.5, seed=0)(batch)
    same = [one.equal(picture) for one in made]
    assert 0 < sum(same) < 12
    assert Retexture(picture, ASHIKHMIN, region=region, p=0.0)(batch).equal(batch)


def test_each_picture_may_have_its_region(picture):
    regions = torch.zeros(2, 24, 26, dtype=torch.bool)
    regions[0, :5] = regions[1, 9:] = True
    made = Retexture(picture, ASHIKHMIN, seed=1)(picture.expand(2, -1, -1, -1), regions)
    for number in range(2):
        assert made[number][:, ~regions[number]].equal(picture[:, ~regions[number]])


ALL = torch.ones(24, 26, dtype=torch.bool)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda picture: Synthesize(picture.expand(2, -1, -1, -1)), "exemplar: must be one picture"),
        (lambda picture: Synthesize(picture, size=(0, 4)), "size: height and width must be at least 1 pixel"),
        (lambda picture: Retexture(picture, p=1.5), "p: must lie from 0 to 1"),
        (lambda picture: Retexture(picture)(picture), "region: must be given to the module or its call"),
        (lambda picture: Retexture(picture)(picture, torch.ones(3, 3) > 0), "region: must have the image's shape"),
        (lambda picture: Fill(hole=torch.ones(24, 26) > 0)(picture), "hole: must leave something of the picture"),
        (lambda picture: Fill(hole=torch.ones(4, 4) > 0)(picture), "hole: must have the image's shape"),
        (lambda picture: Fill(hole=torch.ones(24, 26))(picture), "hole: must be a boolean tensor"),
        (lambda picture: Fill()(picture[None][:0]), "image: must have at least one pixel"),
        (lambda picture: Retexture(picture, region=ALL)((picture * 255).byte()), "image: must be float32 or float64"),
        (lambda picture: Retexture(picture, region=ALL)(picture[0]), "image: must have shape (C, H, W)"),
        (lambda picture: Retexture(picture, region=ALL)(picture[:1]), "image: must have the exemplar's 3 channel(s)"),
        (lambda picture: Retexture(picture, region=ALL.expand(3, -1, -1))(picture.expand(2, -1, -1, -1)), "region: must be one, or one for each of 2"),
    ],
)  # fmt: skip
def test_mistakes_are_told(picture, make, message):
    with pytest.raises(ts.InputError) as error:
        make(picture)
    assert str(error.value).startswith(message)


def test_a_dataset_is_the_same_for_any_number_of_workers(make_exemplar):
    pictures = {name: make_exemplar(1, 20, 20, seed=seed) for name, seed in (("a", 1), ("b", 2))}
    recipes = [ASHIKHMIN, ts.recipes.wei_levoy(levels=1, neighborhood=3)]
    textures = TextureDataset(pictures, recipes, (8, 9), range(3))
    assert len(textures) == 12
    alone, together = (list(DataLoader(textures, batch_size=5, num_workers=workers)) for workers in (0, 2))
    for one, other in zip(alone, together, strict=True):
        assert one["image"].equal(other["image"])
        assert one["name"] == other["name"]
    assert torch.cat([one["recipe"] for one in alone]).tolist() == [0, 0, 0, 1, 1, 1] * 2
    assert torch.cat([one["seed"] for one in alone]).tolist() == [0, 1, 2] * 4
    seventh = ts.synthesize(pictures["b"], (8, 9), recipes[0], seed=1).image[0]
    assert textures[7]["image"].equal(seventh)
    assert textures[-5]["image"].equal(seventh)
    with pytest.raises(IndexError, match="there are 12 textures"):
        textures[12]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"exemplars": []}, "exemplars: must have at least one"),
        ({"recipes": []}, "recipes: must have at least one"),
        ({"seeds": []}, "seeds: must have at least one"),
        ({"seeds": [-1]}, "seed: must be a whole number"),
        ({"seeds": [0, -1, 2]}, "seed: must be a whole number"),
        ({"exemplars": "sample:brick"}, "exemplars: must be a list, but it is 'sample:brick'"),
        ({"exemplars": ["none.png"]}, "none.png: must be a readable image file"),
        ({"exemplars": [torch.rand(2, 1, 8, 8)]}, "exemplars: must be single pictures"),
    ],
)
def test_datasets_of_nothing_are_told(given, message):
    with pytest.raises(ts.InputError) as error:
        TextureDataset(**{"exemplars": [torch.rand(1, 8, 8)], **given})
    assert str(error.value).startswith(message)


def test_a_network_learns_textures_apart():
    """A tiny classifier trained on synthesized textures of two samples, and tried on others of them."""
    noise = torch.rand(1, 12, 12, generator=torch.Generator().manual_seed(1))
    samples = {"dark": noise / 2, "bright": 0.5 + noise / 2}
    torch.manual_seed(0)
    network = nn.Sequential(
        nn.Conv2d(1, 4, 3), nn.Tanh(), nn.AdaptiveAvgPool2d(1), nn.Flatten(), nn.Linear(4, 2)
    )
    optimizer = torch.optim.Adam(network.parameters(), 0.05)
    textures = TextureDataset(samples, [ASHIKHMIN], (8, 8), range(8))
    loader = DataLoader(textures, batch_size=8, shuffle=True, generator=torch.Generator().manual_seed(0))
    losses = []
    for _ in range(12):
        for batch in loader:
            loss = nn.functional.cross_entropy(network(batch["image"]), batch["exemplar"])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            losses.append(loss.item())
    assert losses[-1] < losses[0] / 3
    others = TextureDataset(samples, [ASHIKHMIN], (8, 8), range(100, 104))
    batch = next(iter(DataLoader(others, batch_size=8)))
    assert network(batch["image"]).argmax(1).equal(batch["exemplar"])
