"""Texts of the page."""

from __future__ import annotations

from torchsynth.studio.toolkit import gr


def html(text: str, name: str | None = None) -> gr.HTML:
    """A piece of HTML in the page's own style."""
    return gr.HTML(text, elem_id=name, padding=False, apply_default_css=False)


def section(title: str) -> gr.HTML:
    """The heading of a part of the page."""
    return html(f"<div class='section'>{title}</div>")


def hint(text: str, name: str | None = None) -> gr.HTML:
    """A sentence on what can be done here."""
    return html(f"<div class='hint'>{text}</div>", name)
