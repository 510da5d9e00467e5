"""How the installed services are: `acqd service status`."""

from __future__ import annotations

import subprocess
import time
from dataclasses import dataclass

from acqd.installation.plan import SERVICES, Wanted, configuration_of, user_of
from acqd.installation.present import present_in
from acqd.installation.root import Root

FAILING = "failing"
_STEADY_S = 60.0
"""A service that was restarted several times has to run for so long before it counts as running."""
_PROPERTIES = "ActiveState,SubState,NRestarts,StateChangeTimestamp,StateChangeTimestampMonotonic"


@dataclass(frozen=True, slots=True)
class State:
    """An installed service."""

    service: str
    unit: str
    enabled: bool
    """Whether it starts with the computer."""
    state: str
    """In systemd's words, or `failing` where it ends again and again; `-` below another root."""
    since: str
    """When it came into this state."""
    configuration: str
    user: str
    """At the broker; empty where no password was made for it."""
    last_line: str = ""
    """Of its log, where it does not run."""

    @property
    def fine(self) -> bool:
        """Whether it runs, or is not to run; a timer waits."""
        return not self.enabled or self.state in ("-", "active", "activating", "reloading")


def states(root: Root) -> list[State]:
    """Every installed service; of the bridges, which share a unit, the enabled ones."""
    present = present_in(root.at)
    wanted = Wanted("acqd", device=present.device)
    shown = [name for name in present.services if not name.startswith("bridge-") or name in present.enabled]
    found = []
    for name in shown:
        service = SERVICES[name]
        state, since = state_of(service.enabled) if root.live else ("-", "")
        found.append(
            State(
                name, service.enabled, name in present.enabled, state, since,
                configuration_of(service.login, present.earlier), user_of(wanted, name) if present.broker else "",
                last_line(service.enabled) if state in ("failed", FAILING) else "",
            )
        )  # fmt: skip
    return found


def state_of(unit: str) -> tuple[str, str]:
    """State of a unit and since when, as systemd says them; `failing` for one that it starts again and again.

    Between two starts systemd calls such a unit activating, and for a moment active. "unknown" without systemd.
    """
    lines = _said("systemctl", "show", f"--property={_PROPERTIES}", unit).splitlines()
    values = dict(line.partition("=")[::2] for line in lines)
    state, since = values.get("ActiveState", "unknown"), values.get("StateChangeTimestamp", "")
    restarts, changed = (values.get(key, "") for key in ("NRestarts", "StateChangeTimestampMonotonic"))
    unsteady = int(restarts or 0) > 1 and time.clock_gettime(time.CLOCK_MONOTONIC) - int(changed or 0) / 1e6 < _STEADY_S
    if values.get("SubState") == "auto-restart" or (unsteady and state in ("active", "activating")):
        return FAILING, since
    return state, since


def last_line(unit: str) -> str:
    """The newest line that the program of a unit has logged, without its name; empty where none is known."""
    said = _said("journalctl", "--unit", unit, "--lines", "20", "--output", "cat", "--no-pager").splitlines()
    ours = [line.removeprefix("acqd: ") for line in said if line.startswith("acqd: ")]
    return ours[-1] if ours else ""


def _said(*command: str) -> str:
    """What a program of systemd prints; empty without it."""
    try:
        return subprocess.run(command, capture_output=True, text=True, check=False, timeout=10).stdout
    except (OSError, subprocess.TimeoutExpired):
        return ""
