"""What was found in the rows of one log, and what a user should know of it."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.robot.clock_fault import ClockFault
from acqd.robot.resolution import COARSE_S, Smoothing
from acqd.robot.row_clock import LateStamps
from acqd.rounded_times import Rebuilt

_NOTEWORTHY = 0.002
"""Share of the rows in motion from which on a user hears of rows that were left out."""
_HELD_SHARE = 0.3
"""Share of equal poses from which on the recorder is faster than the controller."""


@dataclass(frozen=True, slots=True)
class MotionQuality:
    """What was found in the rows of one log; counts are of rows while the arm moves."""

    rows: int = 0
    moving: int = 0
    """Rows while the arm moves, in which a fault can be seen."""
    repeated: int = 0
    """Rows that repeat the pose of the row before."""
    old: int = 0
    """Rows whose pose is older than their stamp."""
    early: int = 0
    """Rows whose pose is newer than their stamp."""
    age_s: float = 0.0
    """Median age of the old poses."""
    row_s: float = 0.0
    """Usual time between rows with different poses."""
    unwrapped: tuple[str, ...] = ()
    """Joints whose angle jumped by whole turns."""
    by_itself: tuple[str, ...] = ()
    """Joints whose angle is refreshed every few rows only, or once it has changed by a deadband."""
    frozen: tuple[str, ...] = ()
    """Joints whose angle stays for some rows while the joint moves on."""
    frozen_rows: int = 0
    """Rows that were left out because of them."""
    zero: tuple[str, ...] = ()
    """Joints whose angle is 0 in every row while others move."""
    unmeasured: tuple[str, ...] = ()
    """Quantities that do not change while the arm moves: "the torque of every joint"."""
    unusable: tuple[str, ...] = ()
    """Quantities that contradict the angles or their unit, each with the reason."""
    rebuilt: Rebuilt | LateStamps | None = None
    """How the times of rows that share a stamp, or were stamped late, were put right."""
    fault: ClockFault | None = None
    """Why the times are not quite those of the poses."""
    smoothing: Smoothing | None = None
    """How finely positions and times are written, where the positions had to be smoothed."""
    drawn_s: float = 0.0
    """Time between the poses of which the rows were computed; 0 if all rows were recorded."""
    by_speeds: tuple[str, ...] = ()
    """Joints whose position is written to few digits, and taken from their speed."""

    @property
    def bad(self) -> int:
        """Rows that were left out."""
        return self.repeated + self.old + self.early

    @property
    def bad_share(self) -> float:
        """Of the rows while the arm moves."""
        return self.bad / max(self.moving, 1)

    @property
    def times_put_right(self) -> bool:
        """Whether the times of all rows were put right."""
        return self.rebuilt is not None and not (isinstance(self.rebuilt, LateStamps) and self.rebuilt.few)

    @property
    def coarse(self) -> bool:
        """Whether fast motion is lost, so that the log cannot tell a supply's lag.

        Times put right are as unsure as such a lag: the scatter that is left in them looks like a longer one.
        """
        return self.times_put_right or (self.smoothing is not None and self.smoothing.coarse) or self.drawn_s > COARSE_S

    @property
    def age_error_s(self) -> float:
        """By how much the poses that were kept may be older than their stamps, all alike.

        A recorder that is faster than the controller stamps a new pose up to one of its rows late; stamps with few
        digits may be cut off or rounded.
        """
        stamp_s = self.rebuilt.error_s if self.rebuilt else self.smoothing.age_error_s if self.smoothing else 0.0
        share = self.repeated / max(self.moving, 1)
        stamp_s += self.fault.missing_s / 2 if self.fault else 0.0
        return stamp_s + (self.row_s * (1 - share) if share > _HELD_SHARE else 0.0)

    def as_json(self) -> dict[str, object]:
        """For manifests and reports."""
        return {
            "rows": self.rows,
            "moving_rows": self.moving,
            "repeated": self.repeated,
            "old": self.old,
            "early": self.early,
            "age_ms": round(1000 * self.age_s, 2),
            "unwrapped": list(self.unwrapped),
            "refreshed_by_itself": list(self.by_itself),
            "frozen": list(self.frozen),
            "frozen_rows": self.frozen_rows,
            "zero": list(self.zero),
            "unmeasured": list(self.unmeasured),
            "unusable": list(self.unusable),
            "shared_stamps": self.rebuilt.shared if self.rebuilt else 0,
            "late_stamps_ms": round(1000 * self.rebuilt.most_s, 1) if isinstance(self.rebuilt, LateStamps) else 0.0,
            "missing_rows_ms": round(1000 * self.fault.missing_s, 1) if self.fault else 0.0,
            "smoothed_over_ms": round(1000 * self.smoothing.longest_s) if self.smoothing else 0,
            "by_speeds": list(self.by_speeds),
            "drawn_between_ms": round(1000 * self.drawn_s, 1),
        }

    def sentences(self) -> list[str]:
        """What a user should know; empty for a clean log."""
        found = [*([self.rebuilt.sentence()] if self.rebuilt else []), *([self.fault.text] if self.fault else [])]
        found += self.left_out()
        if self.smoothing:
            found.append(self.smoothing.sentence())
        if self.drawn_s:
            found.append(
                f"its rows were computed between poses {1000 * self.drawn_s:.0f} ms apart: motion above "
                f"{0.5 / self.drawn_s:.2g} Hz is not in them; give the log as it was recorded"
            )
        if self.by_speeds:
            found.append(
                f"the position of {', '.join(self.by_speeds)} has few digits: its speed is integrated, and held to it"
            )
        if self.unwrapped:
            found.append(f"unwrapped where they jump by whole turns: {', '.join(self.unwrapped)}")
        if self.by_itself:
            found.append(
                f"the angle of {', '.join(self.by_itself)} is often that of an earlier row while other joints move on: "
                "straight lines between the new values are used; record all joints in every row"
            )
        if self.frozen:
            found.append(
                f"{self.frozen_rows} rows are left out in which the angle of {', '.join(self.frozen)} stays, and then "
                "jumps: its message or register was not refreshed"
            )
        if self.zero:
            found.append(
                f"the angle of {', '.join(self.zero)} is 0 in every row: if the driver does not know it, gravity and "
                "the order of the axes are wrong"
            )
        found += [f"{each} never changes while the arm moves, and counts as not measured" for each in self.unmeasured]
        found += [f"{each}: left out" for each in self.unusable]
        return found

    def left_out(self) -> list[str]:
        """Which rows were left out; empty if hardly any."""
        found: list[str] = []
        if self.bad_share < _NOTEWORTHY:
            return found
        if self.repeated:
            text = f"{self._rows(self.repeated)} the pose of the row before repeated"
            if self.repeated > _HELD_SHARE * self.moving:
                text += f": the controller's poses come every {1000 * self.row_s:.0f} ms, record them at that rate"
            found.append(text)
        if self.old:
            found.append(f"{self._rows(self.old)} a pose about {1000 * self.age_s:.0f} ms older than their time stamp")
        if self.early:
            found.append(f"{self._rows(self.early)} a pose newer than their time stamp")
        if found:
            found[-1] += "; these rows are left out"
        return found

    def _rows(self, count: int) -> str:
        return f"{count} of {self.moving} rows in motion ({100 * count / max(self.moving, 1):.1f} %) hold"
