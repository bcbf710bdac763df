"""The exceptions torchsynth raises on purpose.

Every message has the same four parts, so that a reader knows what to change: the *subject* (which
input), the *expectation*, the *fact* that broke it, and the *remedy*.
"""

from __future__ import annotations


class TorchsynthError(Exception):
    """Base of every error torchsynth raises on purpose; never raised itself.

    Args:
        subject: Which input is at fault, as the caller knows it: ``exemplar``, ``size``, a path.
        expectation: What it has to be.
        fact: What it is instead.
        remedy: What to change.

    Example:
        >>> print(InputError("size", "sides must be at least 1", "got 0x64", "pass two numbers"))
        size: sides must be at least 1, but got 0x64; pass two numbers
    """

    def __init__(self, subject: str, expectation: str, fact: str, remedy: str) -> None:
        super().__init__(subject, expectation, fact, remedy)
        self.subject = subject
        self.expectation = expectation
        self.fact = fact
        self.remedy = remedy

    def __reduce__(self) -> tuple[type[TorchsynthError], tuple[str, str, str, str]]:
        # OSError keeps other arguments than it was given, and errors do travel between processes.
        return type(self), (self.subject, self.expectation, self.fact, self.remedy)

    def __str__(self) -> str:
        return f"{self.subject}: {self.expectation}, but {self.fact}; {self.remedy}"


class InputError(TorchsynthError, ValueError):
    """An image, a size, a seed or another argument cannot be used."""


class ConfigError(TorchsynthError, ValueError):
    """A recipe, or the YAML it was read from, is wrong."""


class OutputError(TorchsynthError, OSError):
    """A result cannot be written where it was asked for."""
