"""Default folders of what is computed from a dataset."""

from __future__ import annotations

from pathlib import Path


def default_folder(dataset: Path, kind: str) -> Path:
    """`ds.KIND` next to `ds`."""
    resolved = dataset.resolve()
    folder = resolved.with_name(f"{resolved.name}.{kind}")
    return folder if dataset.is_absolute() or dataset.name in ("", ".", "..") else dataset.parent / folder.name


def default_models(dataset: Path) -> Path:
    """`ds.models` next to `ds`."""
    return default_folder(dataset, "models")
