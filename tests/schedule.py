"""Which worker of pytest-xdist takes which test."""

from __future__ import annotations

from typing import Any

from xdist.scheduler import LoadGroupScheduling

WAITING = (
    "daemon/", "doubles/", "integrations/", "plc/", "sidecar/", "sources/", "storage/", "telemetry/", "web/",
    "cli/test_run.py", "cli/test_status.py", "tools/test_faults.py", "tools/test_soak.py",
)  # fmt: skip
"""Rooms and modules whose tests wait for devices, brokers, databases and processes."""


def waits(nodeid: str) -> bool:
    """Whether a test mostly waits."""
    return nodeid.startswith(tuple(f"tests/{place}" for place in WAITING))


class OneWaits(LoadGroupScheduling):
    """The first worker takes the tests that wait, the others those that compute; who has none left helps the rest.

    In the order of the rooms all workers would wait at the same time, and later compute at the same time. A module's
    tests stay together: every worker that ran one of them would make the module's fixtures.
    """

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._exhausted: set[bool] = set()

    def _split_scope(self, nodeid: str) -> str:
        scope: str = super()._split_scope(nodeid)  # the group of a test that has one
        return scope.partition("::")[0]

    def _assign_work_unit(self, node: Any) -> None:
        wanted = node is self.nodes[0]
        if wanted not in self._exhausted:
            unit = next((scope for scope in self.workqueue if waits(scope) == wanted), None)
            if unit is None:
                self._exhausted.add(wanted)
            else:
                self.workqueue.move_to_end(unit, last=False)
        super()._assign_work_unit(node)
