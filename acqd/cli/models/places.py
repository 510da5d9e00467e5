"""Where bundles go when nobody says."""

from __future__ import annotations

from pathlib import Path


def default_folder(dataset: Path, kind: str) -> Path:
    """`ds.KIND` beside `ds`."""
    whole = dataset.resolve()
    folder = whole.with_name(f"{whole.name}.{kind}")
    return folder if dataset.is_absolute() or dataset.name in ("", ".", "..") else dataset.parent / folder.name


def default_models(dataset: Path) -> Path:
    """`ds.models` beside `ds`."""
    return default_folder(dataset, "models")
