"""Home Assistant itself discovers a simulated daemon on a real mosquitto; both are restarted, entities are removed.

    python -m tools.studies.homeassistant --python HA/bin/python [--json] [--captured FILE]

HA is an environment with Home Assistant and what its integrations mqtt, recorder and energy need:

    python3.11 -m venv HA
    HA/bin/pip install homeassistant==2024.3.3 paho-mqtt==1.6.1 SQLAlchemy==2.0.27 fnv-hash-fast==0.5.0 \\
        psutil-home-assistant==0.0.1 aiohttp_cors==0.7.0 aiohttp-fast-url-dispatcher==0.3.0 \\
        aiohttp-zlib-ng==0.3.1 janus==1.0.0 numpy==1.26.0

Exit 1: a check has failed. --captured writes the discovery messages that this Home Assistant has accepted, for the
test that compares acqd's messages with them.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from acqd.telemetry.event import PowerEvent
from acqd.telemetry.ports import free_port
from acqd.timestamps import filetime, rfc3339
from tools.common.commands import acqd, acqd_command
from tools.common.ending import end_in_order
from tools.studies.faults.process import Process
from tools.studies.faults.servers import broker
from tools.studies.homeassistant.probe import Probe

DEVICE = "cell.1"
"""With a character that a discovery topic may not have."""
_EXPECTED = {
    "P": ("power", "measurement", "W"), "PF": ("power_factor", "measurement", None),
    "Vrms": ("voltage", "measurement", "V"), "Irms": ("current", "measurement", "A"),
    "f": ("frequency", "measurement", "Hz"), "W_import": ("energy", "total_increasing", "kWh"),
    "V_u2": (None, "measurement", "%"),
}  # fmt: skip
Entities = dict[str, Any]


class Study:
    """One bed: broker, daemon, bridge and Home Assistant."""

    def __init__(self, python: Path, folder: Path) -> None:
        self._python, self._folder = python, folder
        self.port = free_port()
        self.broker = broker("mosquitto", folder, self.port)
        (folder / "ha").mkdir()
        (folder / "acqd.toml").write_text(
            f'device = "{DEVICE}"\nstate_dir = "{folder}/state"\n[mqtt]\nport = {self.port}\n[health]\nport = 0\n'
            '[spool]\nuntil = "acknowledged"\n[realtime]\npriority = 0\nlock_memory = false\n'
            "[quality]\nenabled = true\n[events]\nenabled = true\ndeclared_voltage = 230.0\n"
        )
        self.daemon = self._service("run", "daemon")
        self.bridge = self._service("bridge homeassistant", "bridge")
        self.checks: list[tuple[str, bool, str]] = []

    def run(self) -> None:
        """All checks."""
        self.broker.start()
        self.daemon.start()
        self.bridge.start()
        with self._home() as home:
            self._check("MQTT integration connects", home.ask("connect", "127.0.0.1", self.port) == "create_entry")
            self._check("entities are discovered", home.wait_for(_alive, "entities with values", 120))
            self._events(home)
            self._classes(home.ask("states"))
            self._statistics(home)
            self._daemon_restarts(home)
            self._broker_restarts(home)
        with self._home() as home:
            self._check("entities after a restart of Home Assistant", home.wait_for(_alive, "entities with values"))
            self.captured = self._messages()
            self.bridge.stop()
            print(acqd("bridge", "homeassistant", "--remove", "--port", self.port).strip())
            self._check("entities are gone after --remove", home.wait_for(lambda found: not found, "no entities"))
            self._check("no message is left with the broker", not self._messages())

    def stop(self) -> None:
        """What is still running."""
        for process in (self.bridge, self.daemon, self.broker):
            process.stop()

    def _service(self, command: str, name: str) -> Process:
        arguments = acqd_command(*command.split(), "--config", self._folder / "acqd.toml")
        return Process(arguments, self._folder / f"{name}.log")

    @contextlib.contextmanager
    def _home(self) -> Iterator[Probe]:
        with Probe(self._python, self._folder / "ha") as home:
            yield home

    def _check(self, what: str, good: bool, seen: object = "") -> None:
        self.checks.append((what, good, str(seen)))

    def _classes(self, found: Entities) -> None:
        by_id = {entry["unique_id"]: entry for entry in found.values()}
        for key, wanted in _EXPECTED.items():
            entry = next((by_id[name] for name in by_id if name.endswith(f"_total_{key}")), None)
            about = entry["attributes"] if entry else {}
            seen = tuple(about.get(name) for name in ("device_class", "state_class", "unit_of_measurement"))
            self._check(f"class and unit of {key}", seen == wanted, f"{seen} {entry and entry['state']}")
        disabled = sum(entry["disabled"] for entry in found.values())
        self._check("S, net and returned energy wait to be enabled", disabled == 12, f"{disabled} of {len(found)}")

    def _events(self, home: Probe) -> None:
        """A dip as the daemon would tell it: when it begins and when it has ended."""
        name = _entity(home.ask("states"), "_voltage_event")
        ns = time.time_ns()
        for duration in (None, 0.1):
            dip = PowerEvent(
                DEVICE, "b", 1, "dip", rfc3339(ns), filetime(ns), duration, 161.0, 230.0, False, None, ["L1"], [], None
            )
            command = ["mosquitto_pub", "-p", str(self.port), "-t", f"acqd/{DEVICE}/event", "-q", "1", "-s"]
            subprocess.run(command, input=dip.to_json(), check=True)
            fired = home.wait_for(
                lambda found: found[name]["attributes"].get("event_type") == "dip", "a dip", 10 if duration else 3
            )
            about = home.ask("states")[name]["attributes"]
            self._check(
                f"event of a dip that {'has ended' if duration else 'goes on'}",
                fired == (duration is not None),
                about.get("extreme_V"),
            )

    def _statistics(self, home: Probe) -> None:
        entity = _entity(home.ask("states"), "_total_W_import")
        time.sleep(5)
        answer = home.ask("statistics", entity)
        rows = answer["rows"].get(entity, [])
        sums = [row.get("sum") for row in rows]
        accepted = bool(answer["about"]) and answer["about"][0]["has_sum"] and sums[-1:] != [None] and bool(sums)
        self._check("recorder sums the energy", accepted, f"{answer['about']} {rows[-1:]}")
        complaints = [issue for group in home.ask("energy", entity)["energy_sources"] for issue in group]
        self._check("energy dashboard accepts the entity", not complaints, complaints or entity)

    def _daemon_restarts(self, home: Probe) -> None:
        self.daemon.stop()
        gone = home.wait_for(lambda found: _states(found) <= {"unavailable"}, "all unavailable")
        self._check("unavailable while the daemon is stopped", gone)
        self.daemon.start()
        self._check("values after a restart of the daemon", home.wait_for(_alive, "values"))
        self.daemon.kill()
        gone = home.wait_for(lambda found: _states(found) <= {"unavailable"}, "all unavailable")
        self._check("unavailable after the daemon was killed (last will, within 60 s)", gone)
        self.daemon.start()
        self._check("values after the next start", home.wait_for(_alive, "values"))

    def _broker_restarts(self, home: Probe) -> None:
        self.broker.stop(signal.SIGTERM)
        self._check("unavailable without a broker", home.wait_for(lambda found: not _alive(found), "no values"))
        self.broker.start()
        self._check("values after a restart of the broker", home.wait_for(_alive, "values", 120))

    def _messages(self) -> dict[str, Any]:
        """Retained discovery messages."""
        command = ["mosquitto_sub", "-p", str(self.port), "-t", "homeassistant/+/+/+/config", "-W", "2", "-F", "%t %p"]
        lines = subprocess.run(command, capture_output=True, text=True, check=False).stdout.splitlines()
        return {line.partition(" ")[0]: json.loads(line.partition(" ")[2]) for line in lines}


def _states(found: Entities) -> set[str]:
    shown = (entry for name, entry in found.items() if not name.startswith("event."))  # unknown before the first one
    return {str(entry["state"]) for entry in shown if not entry["disabled"]}


def _alive(found: Entities) -> bool:
    return bool(_states(found)) and not _states(found) & {"unavailable", "unknown", "None"}


def _entity(found: Entities, end: str) -> str:
    return next(name for name, entry in found.items() if entry["unique_id"].endswith(end))


def main() -> None:
    """Print the checks."""
    end_in_order()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", type=Path, required=True, help="interpreter of Home Assistant's environment")
    parser.add_argument("--captured", type=Path, help="write the discovery messages to this file")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        study = Study(arguments.python, Path(name))
        try:
            study.run()
        finally:
            study.stop()
    if arguments.captured:
        lines = (f"{json.dumps(topic)}: {json.dumps(sent)}" for topic, sent in sorted(study.captured.items()))
        arguments.captured.write_text("{\n" + ",\n".join(lines) + "\n}\n")
    _show(study.checks, as_json=arguments.json)
    sys.exit(not all(good for _, good, _ in study.checks))


def _show(checks: list[tuple[str, bool, str]], *, as_json: bool) -> None:
    if as_json:
        print(json.dumps([{"check": what, "ok": good, "seen": seen} for what, good, seen in checks]))
        return
    table = Table("check", "", "seen", title="Home Assistant with a simulated daemon")
    for what, good, seen in checks:
        table.add_row(what, "ok" if good else "FAILED", seen)
    Console(width=160).print(table)


if __name__ == "__main__":
    main()
