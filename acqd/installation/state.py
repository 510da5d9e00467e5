"""How the installed services are: `acqd service status`."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass

from acqd.installation.plan import SERVICES, Wanted, configuration_of, user_of
from acqd.installation.present import present_in
from acqd.installation.root import Root


@dataclass(frozen=True, slots=True)
class State:
    """An installed service."""

    service: str
    unit: str
    enabled: bool
    """Whether it starts with the computer."""
    state: str
    """In systemd's words; `-` below another root."""
    since: str
    """When it came into this state."""
    configuration: str
    user: str
    """At the broker; empty where no password was made for it."""

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
        state, since = _of(service.enabled) if root.live else ("-", "")
        found.append(
            State(
                name, service.enabled, name in present.enabled, state, since,
                configuration_of(service.login, present.earlier), user_of(wanted, name) if present.broker else "",
            )
        )  # fmt: skip
    return found


def _of(unit: str) -> tuple[str, str]:
    """State of a unit and since when, as systemd says them; empty without systemd."""
    command = ["systemctl", "show", "--property=ActiveState,StateChangeTimestamp", unit]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=10)
    except (OSError, subprocess.TimeoutExpired):
        return "unknown", ""
    values = dict(line.partition("=")[::2] for line in done.stdout.splitlines())
    return values.get("ActiveState", "unknown"), values.get("StateChangeTimestamp", "")
