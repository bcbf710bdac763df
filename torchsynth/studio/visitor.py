"""What one visitor of the studio has; no two visitors share any of it."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from torch import Tensor

from torchsynth.controls import Controls
from torchsynth.io import Picture
from torchsynth.lattice import Shape
from torchsynth.result import Result
from torchsynth.studio.running import Ticket


@dataclass(frozen=True)
class Sample:
    """The picture that texture is made from.

    Args:
        name: Its path: ``sample:NAME``, or the name of the file that was uploaded.
        picture: What was read.
    """

    name: str
    picture: Picture

    @property
    def shape(self) -> Shape:
        """Height and width."""
        height, width = self.picture.image.shape[1:]
        return height, width


@dataclass(frozen=True)
class Made:
    """A finished synthesis, with what it was made from.

    Args:
        result: The output.
        sample: What it is made of.
        controls: What was pinned down.
        words: Fields that were given in words.
        painted: Whether something was painted or uploaded, of which there is no file.
        seconds: How long it took.
    """

    result: Result
    sample: Sample
    controls: Controls
    words: dict[str, str]
    painted: bool
    seconds: float


@dataclass
class Visitor:
    """One visitor's sample, last output, computation and files.

    Example:
        >>> visitor = Visitor()
        >>> visitor.begin().cancelled
        False
        >>> visitor.close()
    """

    sample: Sample | None = None
    made: Made | None = None
    ticket: Ticket | None = None
    home: Path | None = None
    fields: dict[str, Tensor] = field(default_factory=dict)

    def begin(self) -> Ticket:
        """Start a computation: the one before it, should it still be running, is cancelled."""
        self.cancel()
        self.ticket = Ticket()
        return self.ticket

    def cancel(self) -> bool:
        """Cancel what is running; whether anything was."""
        if self.ticket is None or self.ticket.ended:
            return False
        self.ticket.cancel()
        return True

    def files(self, kind: str) -> Path:
        """A folder for files of one kind, empty."""
        if self.home is None:
            self.home = Path(tempfile.mkdtemp(prefix="visitor-", dir=os.environ.get("GRADIO_TEMP_DIR")))
        folder = self.home / kind
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        return folder

    def close(self) -> None:
        """End what is running, and remove the files."""
        self.cancel()
        if self.home is not None:
            with contextlib.suppress(OSError):
                shutil.rmtree(self.home)
            self.home = None
