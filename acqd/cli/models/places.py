"""Where bundles go when nobody says."""

from __future__ import annotations

from pathlib import Path


def default_models(dataset: Path) -> Path:
    """`ds.models` beside `ds`."""
    whole = dataset.resolve()
    folder = whole.with_name(f"{whole.name}.models")
    return folder if dataset.is_absolute() or dataset.name in ("", ".", "..") else dataset.parent / folder.name
