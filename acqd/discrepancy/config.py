"""What a run of the loop is asked for."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from acqd.models.yearly import Duty


@dataclass(frozen=True, slots=True)
class CloseConfig:
    """One run of `acqd close-loop`."""

    dataset: Path
    bundle: Path
    out: Path
    reference: Path | None = None
    """Dataset to compare with; None: the recordings that the bundle remembers."""
    max_effects: int = 5
    only: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    seed: int = 1
    robot: str | None = None
    """Description; None: the bundle's."""
    since_s: float | None = None
    """UTC (Unix s); recordings that end before are left out."""
    further: tuple[Path, ...] = ()
    """More datasets in question, each a session with gears that began at a temperature of their own."""
    duty: Duty = field(default_factory=Duty)
    """For the energy and the cost of a cause per year."""

    def as_json(self) -> dict[str, Any]:
        """What was asked for, for report.json; `from_json` reads it again."""
        return {
            "dataset": str(self.dataset), "with": [str(path) for path in self.further], "model": str(self.bundle),
            "reference": None if self.reference is None else str(self.reference), "max_effects": self.max_effects,
            "only": list(self.only), "exclude": list(self.exclude), "seed": self.seed, "robot": self.robot,
            "since_s": self.since_s,
        }  # fmt: skip

    @classmethod
    def from_json(cls, asked: dict[str, Any], out: Path) -> CloseConfig:
        """The same run once more. Raises KeyError, TypeError for what `as_json` did not write."""
        return cls(
            _named(asked["dataset"], out), _named(asked["model"], out), out,
            None if asked["reference"] is None else _named(asked["reference"], out), asked["max_effects"],
            tuple(asked["only"]), tuple(asked["exclude"]), asked["seed"], asked["robot"], asked["since_s"],
            tuple(_named(path, out) for path in asked["with"]),
        )  # fmt: skip


def _named(name: str, out: Path) -> Path:
    """A folder as the run named it; where that was run from another folder, seen from one above the report."""
    given = Path(name)
    if given.exists() or given.is_absolute():
        return given
    return next((path for above in out.resolve().parents if (path := above / given).exists()), given)
