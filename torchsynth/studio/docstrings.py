"""What a docstring says, piece by piece: its first line, and what it says about each argument."""

from __future__ import annotations

import re

_SECTION = re.compile(r"^(?P<title>[A-Z]\w*):(?P<rest>.*)$")
_ENTRY = re.compile(r"^    (?P<name>\w+): (?P<text>.*)$")
_ROLE = re.compile(r":\w+:`~?([^`]+)`")
_MEANING = re.compile(r"\bNone means ([^.;,:]+)")
_SENTENCE = re.compile(r"(?<=[.!?])\s+(?=[A-Z`])")


def summary(docstring: str) -> str:
    r"""The first line of a docstring, without marks.

    Example:
        >>> summary("Take the ``best``.\n\nAnd more.")
        'Take the best.'
    """
    return _plain(docstring.strip().partition("\n\n")[0])


def arguments(docstring: str) -> dict[str, str]:
    r"""What the ``Args`` section of a Google docstring says, by argument.

    Args:
        docstring: With its indentation removed, as ``inspect.getdoc`` or a JSON schema gives it.

    Example:
        >>> arguments("Do it.\n\nArgs:\n    size: Its side,\n        odd.\n\nRaises:\n    E: Or else.")
        {'size': 'Its side, odd.'}
    """
    found: dict[str, list[str]] = {}
    inside, latest = False, ""
    for line in docstring.splitlines():
        section = _SECTION.match(line)
        if section:
            inside = section["title"] == "Args"
            continue
        entry = _ENTRY.match(line) if inside else None
        if entry:
            latest = entry["name"]
            found[latest] = [entry["text"]]
        elif inside and latest:
            found[latest].append(line.strip())
    return {name: _plain(" ".join(lines)) for name, lines in found.items()}


def brief(text: str) -> str:
    """The sentences that tell somebody at a control what it does: the first, and the visible effect.

    Example:
        >>> brief("Its side. It is odd. Visible effect: larger is slower. Source: section 2.")
        'Its side. Larger is slower.'
    """
    first, *others = _SENTENCE.split(text)
    effects = [one.partition(": ")[2] for one in others if one.startswith("Visible effect")]
    return " ".join([first, *(f"{one[:1].upper()}{one[1:]}" for one in effects)])


def unset(text: str) -> str:
    """What an argument means that is not given, in the words of its description.

    Example:
        >>> unset("How far they overlap. None means a sixth of the block.")
        'a sixth of the block'
        >>> unset("How many leaves.")
        'none'
    """
    meaning = _MEANING.search(text)
    return meaning[1] if meaning else "none"


def _plain(text: str) -> str:
    return " ".join(_ROLE.sub(r"\1", text).replace("``", "").replace("*", "").split())
