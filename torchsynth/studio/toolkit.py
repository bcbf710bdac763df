"""Gradio, imported for this page: quickly, and without a word to any other machine."""

from __future__ import annotations

import importlib.abc
import importlib.machinery
import os
import sys
from types import ModuleType
from typing import Any

_SLOW = "gradio.component_meta"


class _NoStubs(importlib.abc.MetaPathFinder):
    """Leaves out that gradio, whenever it is imported, writes stub files for editors: more than half its time."""

    def find_spec(
        self,
        fullname: str,
        path: Any,  # noqa: ANN401 (as the import system has it)
        _target: ModuleType | None = None,
    ) -> importlib.machinery.ModuleSpec | None:
        spec = importlib.machinery.PathFinder.find_spec(fullname, path) if fullname == _SLOW else None
        if spec is None or spec.loader is None:
            return None
        load = spec.loader.exec_module

        def load_without(module: ModuleType) -> None:
            load(module)
            module.__dict__["create_or_modify_pyi"] = lambda *_: None

        spec.loader.exec_module = load_without  # type: ignore[method-assign]
        return spec


os.environ["GRADIO_ANALYTICS_ENABLED"] = "False"  # is read while gradio is imported
os.environ.setdefault("HF_HUB_OFFLINE", "1")
_finder = _NoStubs()
sys.meta_path.insert(0, _finder)
try:
    import gradio as gr
finally:
    sys.meta_path.remove(_finder)

__all__ = ["gr"]
