"""The files of a job, read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from torchsynth.codebook import Codebook
from torchsynth.errors import InputError
from torchsynth.io import Picture, read_picture
from torchsynth.records import Job, paths_of
from torchsynth.source_map import SavedSource, read_source_map
from torchsynth.wishes import FIELDS, check_field_word

_NO_PICTURES = ("codebook", "source_map")


@dataclass(frozen=True)
class Inputs:
    """What the files of a job hold.

    Args:
        pictures: The pictures, by what they are for.
        codebook: The trained trees, if there are any.
        source: The source map of the output to be refined, if there is one.
    """

    pictures: dict[str, Picture]
    codebook: Codebook | None = None
    source: SavedSource | None = None

    @classmethod
    def read(cls, job: Job) -> Inputs:
        """Read them all.

        Raises:
            InputError: If one cannot be used, or is not the one that a record was made with.

        Example:
            >>> job = Job("sample:brick", None, None, (0,))
            >>> tuple(Inputs.read(job).pictures["exemplar"].image.shape)
            (1, 128, 128)
        """
        for name in FIELDS:
            if getattr(job, name) is not None:
                check_field_word(name, getattr(job, name))
        paths = paths_of(job)
        pictures = {name: read_picture(path) for name, path in paths.items() if name not in _NO_PICTURES}
        codebook = None if job.codebook is None else Codebook.load(job.codebook)
        source = None if job.source_map is None else read_source_map(Path(job.source_map))
        inputs = cls(pictures, codebook, source)
        inputs._check_digests(job)
        return inputs

    @property
    def digests(self) -> dict[str, str]:
        """The SHA-256 of every file, by what it is for."""
        digests = {name: picture.sha256 for name, picture in self.pictures.items()}
        if self.codebook is not None and self.codebook.sha256 is not None:
            digests["codebook"] = self.codebook.sha256
        if self.source is not None:
            digests["source_map"] = self.source.sha256
        return digests

    def _check_digests(self, job: Job) -> None:
        paths, digests = paths_of(job), self.digests
        for name, expected in (job.sha256 or {}).items():
            if digests[name] != expected:
                raise InputError(
                    paths[name], f"must be the file the record was made with (SHA-256 {expected[:12]}...)",
                    f"its SHA-256 is {digests[name][:12]}...",
                    "restore the file, or use 'torchsynth synthesize' for the new one",
                )  # fmt: skip
