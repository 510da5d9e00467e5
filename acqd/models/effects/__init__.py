"""Physical effects that a model may lack: one class in one file of `catalogue` for every effect.

Effects live with the models because a bundle can hold them; `acqd.discrepancy` searches for them. Beside them, a bundle
can hold `laws` without a name.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Iterable, Mapping
from functools import cache

from acqd.models.effects import catalogue
from acqd.models.effects.effect import Effect
from acqd.models.effects.laws import laws


@cache
def library() -> dict[str, Effect]:
    """All effects by id, sorted."""
    classes: list[type[Effect]] = []
    for info in pkgutil.iter_modules(catalogue.__path__):
        module = importlib.import_module(f"{catalogue.__name__}.{info.name}")
        classes += [
            cls
            for _, cls in inspect.getmembers(module, inspect.isclass)
            if issubclass(cls, Effect) and cls.__module__ == module.__name__
        ]
    return {cls.id: cls() for cls in sorted(classes, key=lambda cls: cls.id)}


@cache
def holdable() -> Mapping[str, Effect]:
    """Everything that a bundle can hold, by id: the library's effects, and laws without a name."""
    return library() | laws()


def unmoved(names: Iterable[str]) -> bool:
    """Whether all of these effects switch at times of their own, so that no motion of the arm tells them apart."""
    known = library()
    return all(name in known and known[name].detected in ("rhythm", "bursts") for name in names)
