"""The library: every class derived from `Effect` in a module of this package."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from functools import cache

from acqd.discrepancy.effect import Effect


@cache
def library() -> dict[str, Effect]:
    """All effects by id."""
    found: list[type[Effect]] = []
    for info in pkgutil.iter_modules(__path__):
        module = importlib.import_module(f"{__name__}.{info.name}")
        found += [
            cls
            for _, cls in inspect.getmembers(module, inspect.isclass)
            if issubclass(cls, Effect) and cls.__module__ == module.__name__ and not inspect.isabstract(cls)
        ]
    return {cls.id: cls() for cls in sorted(found, key=lambda cls: cls.id)}
