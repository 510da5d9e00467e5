"""The configuration of a mosquitto on this computer, as far as this user may read it."""

from __future__ import annotations

import contextlib
import itertools
from pathlib import Path

_USUAL = Path("/etc/mosquitto/mosquitto.conf")
_PROCESSES = Path("/proc")


def settings_of_local_broker(processes: Path = _PROCESSES, usual: Path = _USUAL) -> dict[str, str] | None:
    """The last value of each key, included files too; None when no mosquitto runs or its files cannot be read."""
    running = [words for words in _command_lines(processes) if Path(words[0]).name == "mosquitto"]
    if len(running) != 1:
        return None  # with several, which one listens is not known
    try:
        return _settings(_named_file(running[0]) or usual)
    except (OSError, UnicodeDecodeError):
        return None


def _command_lines(processes: Path) -> list[list[str]]:
    lines = []
    for path in processes.glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            words = path.read_bytes().decode(errors="replace").rstrip("\0").split("\0")
            if words[0]:
                lines.append(words)
    return lines


def _named_file(words: list[str]) -> Path | None:
    """The file after -c, which is the only way to name one."""
    for option, value in itertools.pairwise(words):
        if option in ("-c", "--config-file"):
            return Path(value)
    return None


def _settings(path: Path) -> dict[str, str]:
    """mosquitto.conf(5): `key value` lines; include_dir names a folder of *.conf, read in the order of their names."""
    settings: dict[str, str] = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        key, _, value = line.strip().partition(" ")
        if key == "include_dir":
            for included in sorted(Path(value.strip()).glob("*.conf")):
                settings |= _settings(included)
        elif key and not key.startswith("#"):
            settings[key] = value.strip()
    return settings
