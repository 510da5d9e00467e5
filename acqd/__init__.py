"""acqd: an energy twin's measurement chain, from 20 kHz samples to explained power.

The names in `__all__` are the public interface. Their modules are imported when a name is first used (PEP 562), so
that `import acqd` stays small. Types: __init__.pyi.
"""

from __future__ import annotations

from importlib import import_module

__version__ = "0.3.0"

_MODULES = {
    "acqd.api.dataset": ("Dataset",),
    "acqd.api.logs": ("RobotLog", "read_log"),
    "acqd.api.loop": ("LoopResult", "close_loop"),
    "acqd.api.meter": ("Meter", "WindowBatch"),
    "acqd.api.models": ("Model", "export_fmu", "export_onnx", "open_model", "predict", "train"),
    "acqd.api.robot": ("Robot",),
    "acqd.api.rows": ("Rows", "read_rows"),
    "acqd.models.predict": ("Prediction",),
    "acqd.errors": ("InputError", "OperationError", "UserError"),
}
_PLACES = {name: module for module, names in _MODULES.items() for name in names}
_ROOMS = {"datasets": "acqd.api.datasets"}
"""Names that are modules."""
__all__ = sorted([*_PLACES, *_ROOMS, "__version__"])


def __getattr__(name: str) -> object:
    """Import a public name when it is first used."""
    if name in _ROOMS:
        return import_module(_ROOMS[name])
    if name not in _PLACES:
        raise AttributeError(f"module 'acqd' has no attribute {name!r}")
    value = getattr(import_module(_PLACES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
