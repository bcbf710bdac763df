"""How the documentation is built: ``sphinx-build -W docs site``. It needs no network.

The guide is the README itself, and the reference is made of the docstrings. Both are taken from where they are,
so that nothing is written twice: see :func:`link_pages` and :func:`list_modules`.
"""

from __future__ import annotations

import pkgutil
import re
from importlib import import_module
from importlib.metadata import version as version_of
from pathlib import Path

from sphinx.application import Sphinx

import torchsynth

project = "torchsynth"
version = release = version_of("torchsynth-textures")
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build"]

html_theme = "furo"
html_title = "torchsynth"
html_copy_source = False
html_show_copyright = False
html_show_sphinx = False

myst_heading_anchors = 3
napoleon_custom_sections = ["Source", "Convention"]
autodoc_member_order = "bysource"
autodoc_default_options = {"exclude-members": "model_config"}
maximum_signature_line_length = 88

# A reference that leads nowhere is an error, except to other libraries, which are only named, and to what is private.
nitpicky = True
nitpick_ignore_regex = [
    ("py:.*", r"(collections|io|jaxtyping|numpy|pathlib|pydantic|pydantic_core|torch|typer|typing)\..*"),
    ("py:class", r"Tensor|(Bool|Float|Int)\d*|dict\[str"),
    ("py:class", r"torchsynth\.([a-z]+\.)+_\w+"),
    ("py:class", r"torchsynth\.analogy\..*"),  # the module shares its name with a function
]

PAGES = {"README.md": "guide.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
"""The files of the repository that are pages too, and their names here."""


def setup(app: Sphinx) -> None:
    """Connect what follows."""
    app.connect("source-read", list_modules)
    app.connect("source-read", link_included_pages)
    app.connect("include-read", link_pages)
    app.connect("autodoc-process-docstring", keep_colons, priority=100)  # before Napoleon
    app.connect("autodoc-process-signature", show_plain_types)


def link_pages(_app: Sphinx, _path: Path, _parent: str, content: list[str]) -> None:
    """Turn the links of an included file, which start at the repository's root, into links between pages."""
    content[0] = re.sub(r"\]\((?!https?:)([^)#\s]+)(#[^)]*)?\)", _page_link, content[0])


def _page_link(found: re.Match[str]) -> str:
    target, anchor = found[1], found[2] or ""
    if target in PAGES:
        return f"]({PAGES[target]}{anchor})"
    if target.startswith("docs/"):
        return f"]({target.removeprefix('docs/')}{anchor})"
    if target.startswith("torchsynth/") and target.removesuffix(".py").replace("/", "").isidentifier():
        module = target.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
        return f"](#{module})"
    return f"](path:../{target})"


def link_included_pages(_app: Sphinx, _docname: str, content: list[str]) -> None:
    """In the pages themselves, a link to a file that is included leads to the page it is."""
    for path, page in PAGES.items():
        content[0] = content[0].replace(f"](../{path}", f"]({page}")


def list_modules(app: Sphinx, docname: str, content: list[str]) -> None:
    """Have every module documented that no page names: nobody has to remember a new one."""
    if docname != "api/inside":
        return
    named = "\n".join(path.read_text(encoding="utf-8") for path in Path(app.srcdir, "api").glob("*.rst"))
    for module in sorted(one.name for one in pkgutil.walk_packages(torchsynth.__path__, "torchsynth.")):
        internal = module.endswith("__main__") or module.startswith(
            "torchsynth.studio"
        )  # a page, not a library
        if f".. automodule:: {module}\n" not in named and not internal:
            options = "".join(f"   {option}\n" for option in _options(module))
            content[0] += f"\n{module}\n{'-' * len(module)}\n\n.. automodule:: {module}\n{options}"


def _options(module: str) -> list[str]:
    """What is listed of a module: all that is not public in a package, where it has its place already."""
    if module.startswith("torchsynth.cli"):
        return []  # its functions are commands, and described by --help
    packages = [import_module(module.rsplit(".", depth)[0]) for depth in range(1, module.count(".") + 1)]
    public = {
        f"{one.__name__}.{name}": id(getattr(one, name))
        for one in packages
        for name in getattr(one, "__all__", ())
    }
    found = vars(import_module(module)).items()
    members = [name for name, value in found if callable(value) and id(value) in public.values()]
    options = [":members:", f":exclude-members: {', '.join(['model_config', *members])}"]
    return [*options, ":no-index:"] if module in public else options


def keep_colons(
    _app: Sphinx, what: str, _name: str, _found: object, _options: object, lines: list[str]
) -> None:
    """Of ``A range: from here to there`` Napoleon takes the beginning for a type, unless a comment comes first."""
    if what in ("attribute", "data", "property"):
        lines[:0] = ["..", ""]


def show_plain_types(
    _app: Sphinx,
    _what: str,
    _name: str,
    _found: object,
    _options: object,
    signature: str | None,
    returns: str | None,
) -> tuple[str, str | None] | None:
    """Show ``int`` for ``Annotated[int, Ge(ge=1)]``: what it may be is said in words."""
    if signature is None:
        return None
    return _without_annotated(signature), returns and _without_annotated(returns)


def _without_annotated(text: str) -> str:
    """Keep only the first argument of each ``Annotated[...]``."""
    while found := re.search(r"[\w.~]*Annotated\[", text):
        depth, ends = 0, []
        for place in range(found.end(), len(text)):
            depth += (text[place] in "[(") - (text[place] in "])")
            if depth < 0 or (depth == 0 and text[place] == ","):
                ends.append(place)
            if depth < 0:
                break
        text = text[: found.start()] + text[found.end() : ends[0]] + text[ends[-1] + 1 :]
    return text
