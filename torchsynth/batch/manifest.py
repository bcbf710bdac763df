"""What a folder of outputs holds, so that work that was stopped can go on."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from torchsynth.batch.work import Made, Output
from torchsynth.errors import OutputError
from torchsynth.io import staging

NAME = "manifest.json"
"""The manifest's file, in the folder of the outputs."""

_FORMAT = "torchsynth batch 1"

# The manifest is written when it has grown by such a share, so that writing it takes time in proportion to the
# number of outputs, and not to its square.
_SHARE = 1 / 16


@dataclass
class Manifest:
    """The finished outputs of a folder, by key.

    Args:
        folder: Where they are.
        entries: For each key what was made, its files, and the picture's SHA-256.
        unwritten: How many of them its file does not have yet.
    """

    folder: Path
    entries: dict[str, dict[str, Any]] = field(default_factory=dict)
    unwritten: int = 0

    @classmethod
    def read(cls, folder: Path) -> Manifest:
        """That of a folder, empty if there is none yet.

        Raises:
            OutputError: If there is a file of that name that is no manifest.

        Example:
            >>> import tempfile
            >>> with tempfile.TemporaryDirectory() as folder:
            ...     Manifest.read(Path(folder)).entries
            {}
        """
        path = folder / NAME
        if not path.exists():
            return cls(folder)
        try:
            found = json.loads(path.read_bytes())
        except (OSError, ValueError):
            found = None
        entries = found.get("outputs") if isinstance(found, dict) and found.get("format") == _FORMAT else None
        if not isinstance(entries, dict) or not all(isinstance(one, dict) for one in entries.values()):
            raise OutputError(
                str(path), "must be what 'torchsynth batch' wrote", "it is another file, or damaged",
                "move it away: finished outputs are found again by their records",
            )  # fmt: skip
        return cls(folder, entries)

    def holds(self, output: Output, suffix: str) -> bool:
        """Whether an output is there; one that was finished but never noted is noted.

        Args:
            output: Which.
            suffix: The ending of its picture.

        Raises:
            OutputError: If its picture is no longer what was made.
        """
        entry = self.entries.get(output.key) or self._left_behind(output, suffix)
        picture = None if entry is None else self._picture(entry)
        if entry is None or picture is None or not self._is_whole(entry):
            return False
        if hashlib.sha256(picture).hexdigest() != entry.get("sha256"):
            raise OutputError(
                str(self.folder / entry["file"]), "must be as it was made", "it was changed since",
                "move it away to have it made again",
            )  # fmt: skip
        self.entries[output.key] = entry
        return True

    def save(self, finished: Sequence[Made]) -> None:
        """Write the files of some outputs, and, once they are many beside those it names, the manifest.

        Each file is written whole or not at all, and an output's record after its picture. What the manifest's
        file does not name is found again by its record.

        Args:
            finished: The outputs.

        Raises:
            OutputError: If the disk is full, or anything else keeps a file from being written.
        """
        with staging() as put:
            for made in finished:
                for name, data in made.files.items():
                    put(self.folder / name, data)
        for made in finished:
            names = list(made.files)
            entry = {"file": names[0], "sha256": made.sha256, "files": names} | made.output.about
            self.entries[made.output.key] = entry
        self.unwritten += len(finished)
        if self.unwritten >= _SHARE * len(self.entries):
            self.write()

    def write(self) -> None:
        """Write the manifest, whole or not at all.

        Raises:
            OutputError: If the disk is full, or anything else keeps it from being written.
        """
        content = json.dumps({"format": _FORMAT, "outputs": self.entries}, indent=1, sort_keys=True)
        with staging() as put:
            put(self.folder / NAME, content.encode())
        self.unwritten = 0

    def clear(self) -> None:
        """Remove what a process left behind that was killed while it wrote."""
        for path in self.folder.glob(".*.part"):
            pid = path.name.split(".")[-2]
            if pid.isdigit() and not _is_running(int(pid)):
                with contextlib.suppress(OSError):
                    path.unlink()

    def _left_behind(self, output: Output, suffix: str) -> dict[str, Any] | None:
        """The entry of a finished output that did not come into the manifest any more."""
        try:
            record = json.loads((self.folder / f"{output.stem}.json").read_bytes())
            noted = record["batch"]
            if noted["key"] != output.key:
                return None
            names = [*noted["files"], f"{output.stem}.json"]
            entry = {"file": f"{output.stem}{suffix}", "sha256": noted["sha256"], "files": names}
            return entry | output.about
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def _is_whole(self, entry: dict[str, Any]) -> bool:
        """Whether its other files are there, too."""
        names = entry.get("files")
        return isinstance(names, list) and all((self.folder / str(name)).is_file() for name in names)

    def _picture(self, entry: dict[str, Any]) -> bytes | None:
        try:
            return (self.folder / str(entry["file"])).read_bytes()
        except (OSError, KeyError):
            return None


def _is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
