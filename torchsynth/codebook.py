"""Codebooks: the trees of an exemplar, trained once, kept in a file and used in place of training.

A tree depends on the exemplar, on the neighbors that are compared, and on how the search grows its trees. It
does not depend on the output: not on its size, seed, boundary or order, and not on the search's beam. So a
codebook names the three, and is refused wherever one of them is another.

Nothing is stored that follows from the rest: where the members of a leaf begin, and how deep a tree is, are
computed when it is unpacked.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any, Literal

import safetensors.torch
import torch
from jaxtyping import Int8, Int32
from pydantic import BaseModel, Field, ValidationError
from safetensors import SafetensorError
from torch import Tensor

from torchsynth.errors import InputError
from torchsynth.exemplar import Exemplar
from torchsynth.index import candidates
from torchsynth.io import check_writable, reason, staging
from torchsynth.neighborhood import Layer, Planes, layer_weights, layers_at
from torchsynth.part import Part
from torchsynth.recipe import Recipe
from torchsynth.search import TSVQ, Tree
from torchsynth.sweep import Sweep
from torchsynth.versions import versions

SUFFIX = ".safetensors"

_KEY = "torchsynth_codebook"
_EXEMPLAR = "exemplar"
_REMEDY = "train one for it, with torchsynth.train or 'torchsynth train'"


class Training(Part):
    """What a tree depends on, besides the exemplar.

    Args:
        level: The pyramid level whose candidates it holds.
        layers: Which neighbors are compared there; without their own weights.
        weights: How much each squared difference of each layer counts.
        search: How the tree is grown; with the default beam, whatever the recipe's.
        dynamic_range: Whether levels are stretched; see :class:`torchsynth.Recipe`.
    """

    level: Annotated[int, Field(ge=0)]
    layers: Annotated[tuple[Layer, ...], Field(strict=False)]
    weights: Annotated[tuple[int, ...], Field(strict=False)]
    search: TSVQ
    dynamic_range: Literal["own", "finest"] = "own"

    @classmethod
    def of(cls, sweep: Sweep, level: int, recipe: Recipe) -> Training | None:
        """What a sweep of a recipe needs at one level; None if it does not search with trees."""
        search = sweep.search.tree_search
        if search is None:
            return None
        layers = layers_at(sweep.layers, level, recipe.levels)
        return cls(
            level=level,
            layers=tuple(layer.model_copy(update={"weight": 1}) for layer in layers),
            weights=layer_weights(layers, sweep.normalize),
            search=search.model_copy(update={"beam": 1}),
            dynamic_range=recipe.dynamic_range,
        )


def trainings(recipe: Recipe) -> tuple[Training, ...]:
    """What the trees of a recipe depend on, each once, the finest level first.

    Example:
        >>> from torchsynth import recipes
        >>> [training.level for training in trainings(recipes.wei_levoy_tsvq(levels=3))]
        [0, 1, 2]
    """
    needed = [
        Training.of(sweep, level, recipe)
        for level in range(recipe.levels)
        for sweep in recipe.sweeps_at(level)
    ]
    return tuple(dict.fromkeys(training for training in needed if training is not None))


@dataclass(frozen=True)
class PackedTree:
    """A tree in as few bytes as it needs; see :class:`torchsynth.search.Tree`.

    Args:
        centroids: Of every node. They are rounded means of whole numbers from -128 to 127.
        children: The first of the two adjacent children of every node, or -1 for a leaf.
        members: Vectors sorted by leaf.
        counts: How many of them a leaf has; 0 for other nodes.
    """

    centroids: Int8[Tensor, "nodes features"]
    children: Int32[Tensor, " nodes"]
    members: Int32[Tensor, " vectors"]
    counts: Int32[Tensor, " nodes"]

    @classmethod
    def of(cls, tree: Tree) -> PackedTree:
        """Pack a tree."""
        indices = (one.to("cpu", torch.int32) for one in (tree.children, tree.members, tree.counts))
        return cls(tree.centroids.to("cpu", torch.int8), *indices)

    def unpack(self) -> Tree:
        """The tree that was packed."""
        children, members, counts = (one.long() for one in (self.children, self.members, self.counts))
        starts = counts.cumsum(0) - counts
        depth = _depth(children, self.roots)
        return Tree(self.centroids.float(), children, members, starts, counts, depth)

    @property
    def roots(self) -> int:
        """How many exemplars it was trained on: every other node is one of two children."""
        return len(self.children) - 2 * int((self.children >= 0).sum())


@dataclass(frozen=True)
class Codebook:
    """The trained trees of one exemplar; :func:`torchsynth.train` makes one.

    With the versions it was trained with, a codebook gives the same bytes as training anew. It stays
    valid with later ones, and then keeps what was trained.

    Args:
        exemplar: SHA-256 of the exemplar: shape, dtype, values and the region that may be sampled.
        trees: The trees, by what they were trained for.
        versions: Of the libraries that trained it.
        sha256: Of the file it was loaded from; None if it was not.

    Example:
        >>> import tempfile, torch, torchsynth as ts
        >>> exemplar, recipe = torch.rand(1, 16, 16), ts.recipes.wei_levoy_tsvq(levels=1)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = ts.train(exemplar, recipe).save(Path(folder, "book.safetensors"))
        ...     codebook = ts.Codebook.load(path)
        >>> result = ts.synthesize(exemplar, (8, 8), recipe, codebook=codebook)
        >>> result.image.equal(ts.synthesize(exemplar, (8, 8), recipe).image)
        True
    """

    exemplar: str
    trees: Mapping[Training, PackedTree]
    versions: Mapping[str, str] = field(default_factory=versions)
    sha256: str | None = None

    def save(self, path: str | Path, overwrite: bool = False) -> Path:
        """Write the codebook, whole or not at all.

        Args:
            path: Where to; it has to end in ``.safetensors``.
            overwrite: Whether a file that is there already may be replaced.

        Returns:
            The path.

        Raises:
            InputError: If the name has another ending.
            OutputError: If the file exists, or cannot be written.
        """
        target = Path(path)
        check_savable(target, overwrite=overwrite)
        with staging() as put:
            put(target, self.encode())
        return target

    @classmethod
    def load(cls, path: str | Path) -> Codebook:
        """Read a codebook.

        Raises:
            InputError: If the file is missing, damaged, or no codebook.
        """
        try:
            data = Path(path).read_bytes()
        except OSError as error:
            raise InputError(
                str(path), "must be a readable codebook file", reason(error), "check the path"
            ) from None
        return cls.decode(data, str(path))

    def encode(self) -> bytes:
        """The bytes of its file, for use inside :func:`torchsynth.io.staging`."""
        tensors = _named(self.trees.values())
        header = _Header(
            format=1,
            exemplar=self.exemplar,
            trained=tuple(self.trees),
            checksum=_checksum(tensors),
            versions=dict(self.versions),
        )
        return safetensors.torch.save(tensors, {_KEY: header.model_dump_json(exclude_none=True)})

    @classmethod
    def decode(cls, data: bytes, subject: str) -> Codebook:
        """The codebook that a file holds.

        Args:
            data: The file's bytes.
            subject: What to call it in messages.

        Raises:
            InputError: If it holds none, or not all of one.
        """
        try:
            tensors, header = _parse(data)
            trees = {training: _tree(tensors, n) for n, training in enumerate(header.trained)}
            if _checksum(_named(trees.values())) != header.checksum:
                raise _UnusableError("its content has changed since it was written")
        except _UnusableError as error:
            raise InputError(
                subject, "must be a whole codebook, as torchsynth.train makes them", str(error),
                "check the path, or train it again",
            ) from None  # fmt: skip
        return cls(header.exemplar, trees, header.versions, hashlib.sha256(data).hexdigest())

    def tensors(self) -> dict[str, Tensor]:
        """All that it knows as tensors, by name: the trees, and the exemplar's hash as 32 bytes.

        Example:
            >>> import torchsynth as ts
            >>> book = ts.train(torch.rand(1, 16, 16), ts.recipes.wei_levoy_tsvq(levels=1))
            >>> Codebook.of_tensors(tuple(book.trees), book.tensors()).exemplar == book.exemplar
            True
        """
        digest = torch.tensor(list(bytes.fromhex(self.exemplar)), dtype=torch.uint8)
        return {**_named(self.trees.values()), _EXEMPLAR: digest}

    @classmethod
    def of_tensors(cls, trained: Sequence[Training], tensors: Mapping[str, Tensor]) -> Codebook:
        """The codebook of which these are the :meth:`tensors`.

        Args:
            trained: What its trees were trained for, in their order.
            tensors: All of them.
        """
        exemplar = bytes(tensors[_EXEMPLAR].tolist()).hex()
        return cls(exemplar, {training: _tree(tensors, n) for n, training in enumerate(trained)})

    def tree(self, sweep: Sweep, level: int, recipe: Recipe) -> Tree | None:
        """The tree for a sweep of a recipe at one level; None if it does not search with trees."""
        training = Training.of(sweep, level, recipe)
        return None if training is None else self.trees[training].unpack()

    def check(self, exemplar: Exemplar, recipe: Recipe, planes: Planes) -> None:
        """The codebook must have been trained for this exemplar and this recipe.

        Args:
            exemplar: The exemplar.
            recipe: The recipe; its trees may be some of those that are here.
            planes: The exemplar's side.

        Raises:
            InputError: If it was not, or if the recipe has no use for it.
        """
        needed = trainings(recipe)
        if not needed:
            raise InputError(
                "codebook", "must be given to a recipe that searches with trees",
                f"the recipe {recipe.name!r} has no tsvq search", "drop it, or use e.g. wei_levoy_tsvq",
            )  # fmt: skip
        here = digest(exemplar)
        if here != self.exemplar:
            raise InputError(
                "codebook", f"must have been trained on this exemplar (SHA-256 {here[:12]}...)",
                f"it was trained on another image, dtype or valid region ({self.exemplar[:12]}...)", _REMEDY,
            )  # fmt: skip
        for training in needed:
            fact = self._difference(training) or _misfit(self.trees[training], training, planes)
            if fact is not None:
                raise InputError(
                    "codebook", f"must have been trained for the recipe {recipe.name!r} as it is",
                    f"{fact} at level {training.level}", _REMEDY,
                )  # fmt: skip

    def _difference(self, training: Training) -> str | None:
        """What keeps the trees of its level from being the one that is needed; None if one of them is."""
        if training in self.trees:
            return None
        same = [trained for trained in self.trees if trained.level == training.level]
        if not same:
            return "it has no tree"
        near = max(same, key=lambda trained: trained.layers == training.layers)
        if near.layers != training.layers:
            return "it compares another neighborhood"
        if near.dynamic_range != training.dynamic_range:
            return f"its 'dynamic_range' is {near.dynamic_range}, not {training.dynamic_range},"
        if near.weights != training.weights:
            return f"its weights are {near.weights}, not {training.weights},"
        theirs, ours = near.search.model_dump(), training.search.model_dump()
        name = next(name for name in ours if ours[name] != theirs[name])
        return f"its {name!r} is {theirs[name]}, not {ours[name]},"


def digest(exemplar: Exemplar) -> str:
    """SHA-256 of all of an exemplar that training depends on.

    Example:
        >>> digest(Exemplar(torch.zeros(1, 4, 4))) == digest(Exemplar(torch.zeros(1, 1, 4, 4)))
        True
    """
    named = {"image": exemplar.samples, "valid": exemplar.valid, "guide": exemplar.guides}
    return _checksum({name: values for name, values in named.items() if values is not None})


def check_savable(path: Path, *, overwrite: bool) -> None:
    """Whether a codebook can be put there, before the work of training it.

    Raises:
        InputError: If the name has another ending.
        OutputError: If the file exists and may not be replaced, or its folder cannot be written.
    """
    if path.suffix.lower() != SUFFIX:
        raise InputError(
            str(path), f"a codebook must end in {SUFFIX}",
            f"it ends in {path.suffix!r}" if path.suffix else "it has no extension", "rename it",
        )  # fmt: skip
    check_writable(path, overwrite=overwrite)


_TENSORS = tuple(one.name for one in fields(PackedTree))


class _UnusableError(Exception):
    """Why a file is no codebook."""


class _Header(BaseModel):
    """What is written down beside the tensors."""

    format: Literal[1]
    exemplar: str
    trained: Annotated[tuple[Training, ...], Field(min_length=1)]
    checksum: str
    versions: dict[str, str]


def _named(trees: Iterable[PackedTree]) -> dict[str, Tensor]:
    """The tensors of all trees, under the names they have in a file."""
    return {
        f"{number}.{name}": getattr(tree, name).contiguous()
        for number, tree in enumerate(trees)
        for name in _TENSORS
    }


def _checksum(tensors: Mapping[str, Tensor]) -> str:
    """SHA-256 over names, dtypes, shapes and values."""
    found = hashlib.sha256()
    for name in sorted(tensors):
        values = tensors[name].detach().cpu().contiguous().numpy()
        found.update(f"{name} {values.dtype} {values.shape}".encode())
        found.update(values.data)
    return found.hexdigest()


def _parse(data: bytes) -> tuple[dict[str, Tensor], _Header]:
    """The tensors of a file and what is written beside them."""
    try:
        tensors = safetensors.torch.load(data)
    except (SafetensorError, KeyError):  # the second for a dtype that torch does not have
        raise _UnusableError("it is not a safetensors file, or cut short") from None
    header: dict[str, Any] = json.loads(data[8 : 8 + int.from_bytes(data[:8], "little")])
    text = (header.get("__metadata__") or {}).get(_KEY)
    if text is None:
        raise _UnusableError("it holds no codebook")
    try:
        return tensors, _Header.model_validate_json(text)
    except ValidationError as error:
        name = error.errors()[0]["loc"][:1]
        raise _UnusableError(f"its header {' '.join(map(str, name))!r} is missing or unknown") from None


def _tree(tensors: Mapping[str, Tensor], number: int) -> PackedTree:
    """One tree of a file, seen to be whole: nothing in it may lead out of it."""
    names = [f"{number}.{name}" for name in _TENSORS]
    missing = [name for name in names if name not in tensors]
    if missing:
        raise _UnusableError(f"the tensor {missing[0]!r} is missing")
    centroids, children, members, counts = (tensors[name] for name in names)
    kinds = [(one.dtype, one.ndim) for one in (centroids, children, members, counts)]
    if kinds != [(torch.int8, 2)] + 3 * [(torch.int32, 1)]:
        raise _UnusableError(f"the tensors of tree {number} are of other kinds")
    if not len(centroids) == len(children) == len(counts) > 0:
        raise _UnusableError(f"the tensors of tree {number} do not belong together")
    tree = PackedTree(centroids, children, members, counts)
    parents = (children >= 0).nonzero().squeeze(1)
    grown = children[parents].long()
    # Nodes are numbered as they grew, pair after pair in the order of their parents.
    numbered = tree.roots + 2 * torch.arange(len(grown))
    orderly = grown.equal(numbered) and bool((grown > parents).all())
    if tree.roots < 1 or int(children.min()) < -1 or not orderly:
        raise _UnusableError(f"the children in tree {number} are out of range")
    if not (counts > 0).equal(children < 0) or int(counts.sum()) != len(members) or int(members.min()) < 0:
        raise _UnusableError(f"the members in tree {number} are out of range")
    return tree


def _misfit(tree: PackedTree, training: Training, planes: Planes) -> str | None:
    """What is wrong with the size of a tree, if anything: other versions may see other candidates."""
    samples = len(planes.result[training.level].values)
    features = sum(
        len(layer.template.offsets()) * planes.of(layer, training.level).values.shape[2]
        for layer in training.layers
    )
    vectors = samples * int(candidates(training.layers, planes, training.level).sum())
    held = len(tree.members) if training.search.leaf == "nearest" else vectors
    fits = (tree.roots, tree.centroids.shape[1], held) == (samples, features, vectors)
    if fits and int(tree.members.max()) < vectors:
        return None
    return f"its tree does not fit the {vectors} candidates of {features} values"


def _depth(children: Tensor, roots: int) -> int:
    """The number of steps from a root to the deepest leaf."""
    depth, level = 0, children[:roots]
    while bool((level >= 0).any()):
        first = level[level >= 0]
        depth, level = depth + 1, torch.cat((children[first], children[first + 1]))
    return depth
