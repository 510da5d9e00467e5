"""Physical effects that a model may lack: every class derived from `Effect` in a module of this package.

They live with the models because a bundle can hold them; who looks for them is `acqd.discrepancy`.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from functools import cache

from acqd.models.effects.effect import Effect


@cache
def library() -> dict[str, Effect]:
    """All effects by id."""
    found: list[type[Effect]] = []
    for info in pkgutil.iter_modules(__path__):
        module = importlib.import_module(f"{__name__}.{info.name}")
        found += [
            cls
            for _, cls in inspect.getmembers(module, inspect.isclass)
            if issubclass(cls, Effect) and cls.__module__ == module.__name__ and hasattr(cls, "id")
        ]
    return {cls.id: cls() for cls in sorted(found, key=lambda cls: cls.id)}
