"""What an installation consists of: files with owners and modes, and the services to be enabled."""

from __future__ import annotations

import os
import pwd
import re
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path

from acqd.errors import UserError
from acqd.installation.broker_access import BRIDGE, OPERATOR, SIDECAR, SINK, VIEWER, broker_configuration
from acqd.installation.shared_files import shared_text


@dataclass(frozen=True, slots=True)
class Service:
    """A service that can be installed."""

    units: tuple[str, ...]
    enabled: str
    """The unit that is enabled and started."""
    login: str
    """Key of [mqtt] in acqd.toml with its user at the broker; daemon: [mqtt] itself."""


def _bridge(kind: str) -> Service:
    return Service(("acqd-bridge@.service",), f"acqd-bridge@{kind}.service", "bridge")


SERVICES = {
    "daemon": Service(("acqd.service",), "acqd.service", "daemon"),
    "sink": Service(("acqd-sink.service",), "acqd-sink.service", "sink"),
    "maintain": Service(("acqd-maintain.service", "acqd-maintain.timer"), "acqd-maintain.timer", "sink"),
    "sidecar": Service(("acqd-sidecar.service",), "acqd-sidecar.service", "sidecar"),
    "web": Service(("acqd-web.service",), "acqd-web.service", "web"),
    "alarms": Service(("acqd-alarms.service",), "acqd-alarms.service", "bridge"),
    "opcua": Service(("acqd-opcua.service",), "acqd-opcua.service", "bridge"),
    **{f"bridge-{kind}": _bridge(kind) for kind in ("homeassistant", "influx", "marks", "plain", "sparkplug")},
}
LOGINS = {"sink": SINK, "sidecar": SIDECAR, "web": VIEWER, "bridge": BRIDGE, "operator": OPERATOR}
"""Users at the broker besides the device, by key of [mqtt]."""
CONFIGURATION = "/etc/acqd/acqd.toml"
DEFAULT_SERVICES = ("daemon", "sink", "maintain")
_DROP_INS = {"raw-network": "acqd-raw-network.conf", "serial": "acqd-serial.conf"}
_USER = "acqd"
_SYSUSERS = 'u acqd - "acqd power metering" /var/lib/acqd /usr/sbin/nologin\n'
_TMPFILES = "d /etc/acqd 0750 root acqd -\nd /var/lib/acqd 0750 acqd acqd -\nd /var/cache/acqd 0750 acqd acqd -\n"
_CREDENTIAL = "[Service]\nLoadCredential=mqtt.password:/etc/acqd/{user}.password\n"

_ARCHIVE = "# a disk that is away must not keep the daemon from metering\n[Service]\nReadWritePaths=-{folder}\n"
_HIDDEN = tuple(f"/{name}" for name in ("home", "root", "run/user", "tmp", "var/tmp", "proc", "sys", "dev"))
"""Folders that the units do not see."""


@dataclass(frozen=True, slots=True)
class File:
    """A file of the installation, at an absolute path below the root."""

    path: str
    text: str
    mode: int = 0o644
    group: str = "root"
    keep: bool = False
    """Whether an existing file stays as it is: configuration, which a person edits."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """What is to be installed."""

    program: str
    """Path of the command acqd."""
    services: tuple[str, ...] = ()
    """Names in SERVICES; empty: those that are installed, or DEFAULT_SERVICES."""
    device: str | None = None
    """Name of the device, which is also its user at the broker; None: the installed one, or box."""
    drop_ins: tuple[str, ...] = ()
    """raw-network, serial: rights that a source needs."""
    archive: str | None = None
    """Folder for samples outside of the state folder, absolute; the daemon keeps them then."""
    broker: bool | None = None
    """Passwords and access rules for a mosquitto on this computer; None: as installed, at first with them."""
    earlier: tuple[str, ...] = ()
    """Logins whose services have a configuration file of that name, as an earlier version wrote them."""
    passwords: dict[str, str] = field(default_factory=dict, repr=False)
    """New passwords by user of the broker."""

    def __post_init__(self) -> None:
        """Raises UserError for rights and services that are unknown."""
        for what, given, known in (("rights", self.drop_ins, _DROP_INS), ("service", self.services, SERVICES)):
            unknown = set(given) - set(known)
            if unknown:
                raise UserError(f"no {what} {', '.join(sorted(unknown))}; there are {', '.join(known)}")
        if self.archive is not None:
            _check_archive(self.archive)


def files_of(wanted: Wanted) -> list[File]:
    """All files but the broker's password file. Raises UserError where acqd was copied without its files."""
    folders = _TMPFILES + (f"d {wanted.archive} 0750 acqd acqd -\n" if wanted.archive else "")
    made = [File("/etc/sysusers.d/acqd.conf", _SYSUSERS), File("/etc/tmpfiles.d/acqd.conf", folders)]
    for service in wanted.services:
        made += _service_files(wanted, service)
    for name in wanted.drop_ins:
        text = shared_text(f"systemd/{_DROP_INS[name]}")
        made.append(File(f"/etc/systemd/system/acqd.service.d/{name}.conf", text))
    if wanted.archive:
        made.append(File("/etc/systemd/system/acqd.service.d/archive.conf", _ARCHIVE.format(folder=wanted.archive)))
    if wanted.broker:
        made += [
            File("/etc/mosquitto/conf.d/acqd.conf", broker_configuration()),
            File("/etc/mosquitto/acqd.acl", shared_text("config/mosquitto.acl"), 0o640, "mosquitto", keep=True),
        ]
        made += [
            File(f"/etc/acqd/{user}.password", f"{password}\n", 0o600, keep=True)
            for user, password in wanted.passwords.items()
        ]
    return list({file.path: file for file in made}.values())  # services share the configuration


def users_of(wanted: Wanted) -> list[str]:
    """Users of the broker: of the services, and of people who look and acknowledge."""
    return list(dict.fromkeys([*(user_of(wanted, service) for service in wanted.services), VIEWER, OPERATOR]))


def user_of(wanted: Wanted, service: str) -> str:
    """The broker's user of a service: the device's name, or one that is common to all devices."""
    return LOGINS.get(SERVICES[service].login) or wanted.device or "box"


def configuration_of(login: str, earlier: tuple[str, ...]) -> str:
    """The configuration file of services with this login: the common one, or one of an earlier version."""
    return f"/etc/acqd/{login}.toml" if login in earlier else CONFIGURATION


def _service_files(wanted: Wanted, service: str) -> list[File]:
    path = configuration_of(SERVICES[service].login, wanted.earlier)
    made = [
        File(
            path,
            configuration(wanted.device or "box", wanted.archive, users=bool(wanted.broker)),
            0o640,
            "acqd",
            keep=True,
        )
    ]
    for unit in SERVICES[service].units:
        text = shared_text(f"systemd/{unit}").replace("/opt/acqd/.venv/bin/acqd", wanted.program)
        text = text.replace(CONFIGURATION, path)
        text = re.sub(r"^(Documentation=file:|# Installed by hand:).*\n", "", text, flags=re.MULTILINE)
        made.append(File(f"/etc/systemd/system/{unit}", text))
        if wanted.broker and unit.endswith(".service"):
            drop_in = f"/etc/systemd/system/{unit}.d/password.conf"
            made.append(File(drop_in, _CREDENTIAL.format(user=user_of(wanted, service))))
    return made


def check_path(option: str, path: str) -> None:
    """Raises UserError for a path that a unit could not name."""
    if not re.fullmatch(r"(/[\w.@+-]+)+", path) or ".." in path.split("/"):
        raise UserError(f"{option} {path!r}: expected an absolute path of letters, digits, . _ @ + -")


def _check_archive(folder: str) -> None:
    """Raises UserError for a folder that the units could not use."""
    check_path("--archive", folder)
    if any(folder == hidden or folder.startswith(f"{hidden}/") for hidden in _HIDDEN):
        raise UserError(f"--archive {folder}: the service does not see {', '.join(_HIDDEN)}; choose another folder")


def require_reachable(program: str) -> None:
    """Raises UserError where the units could not start the program: the user acqd has to reach its interpreter, too.

    A virtual environment in a home, or made by a Python that lies in one (pyenv, uv), is such a program.
    """
    for file in (program, _interpreter(Path(program))):
        path = Path(file).resolve()
        hidden = next((name for name in _HIDDEN if str(path).startswith(f"{name}/")), None)
        closed = next((one for one in (*reversed(path.parents), path) if not _open_to_service(one)), None)
        if hidden or closed:
            why = f"the units do not see {hidden}" if hidden else f"the user {_USER} may not enter {closed}"
            raise UserError(
                f"{path}, which runs {program}: {why}; "
                "make the environment with the Python of the system: /usr/bin/python3 -m venv /opt/acqd/.venv"
            )
    if not Path(program).is_file() or not os.access(program, os.X_OK):
        raise UserError(f"{program} is no program; expected the path of the command acqd")


def _interpreter(program: Path) -> str:
    """Of a script, as its first line names it; the program itself, unless that is a script."""
    try:
        with program.open("rb") as file:
            first = file.readline(1000)
    except OSError:
        return str(program)
    found = re.match(rb"#!\s*(/\S+)", first)
    return found[1].decode(errors="replace") if found else str(program)


def _open_to_service(path: Path) -> bool:
    """Whether the user of the units may enter the folder or run the file; True where nobody can tell."""
    try:
        status = path.stat()
        user = pwd.getpwnam(_USER)
        groups = os.getgrouplist(_USER, user.pw_gid)
    except KeyError:  # the installation makes the user
        user, groups = None, []
    except OSError:
        return True
    allowed = status.st_mode & 0o001 or (status.st_mode & 0o010 and status.st_gid in groups)
    owned = user is not None and status.st_uid == user.pw_uid and status.st_mode & 0o100
    return bool(allowed or owned) or _has_list(path)


def _has_list(path: Path) -> bool:
    """Whether an access control list names further users, for instance this one."""
    with suppress(OSError):
        return "system.posix_acl_access" in os.listxattr(path)
    return False


def configuration(device: str, archive: str | None = None, *, users: bool) -> str:
    """acqd.toml with every key; with the users of the broker, where passwords are, and where samples are kept."""
    text = files("acqd.daemon").joinpath("acqd.toml").read_text(encoding="utf-8")
    text = re.sub(r'^(# )?device = "[^"]*"', f'device = "{device}"', text, count=1, flags=re.MULTILINE)
    if archive is not None:
        text = re.sub(r"^(\[archive\].*\n)enabled = false", r"\1enabled = true", text, count=1, flags=re.MULTILINE)
        text = re.sub(r'^# folder = "[^"]*"', f'folder = "{archive}"', text, count=1, flags=re.MULTILINE)
    if not users:
        return text
    text = re.sub(r'^# username = "[^"]*"', f'username = "{device}"', text, count=1, flags=re.MULTILINE)
    for login, user in LOGINS.items():
        text = re.sub(rf"^# {login} = {{.*}}", f'{login} = {{ username = "{user}" }}', text, flags=re.MULTILINE)
    return re.sub(r"^# (password_file = .*)", r"\1", text, count=1, flags=re.MULTILINE)


def default_program(argv0: str) -> str:
    """The command acqd that is running, as units should name it."""
    path = Path(argv0).resolve() if "/" in argv0 else Path(argv0)
    return str(path) if path.name == "acqd" else "/opt/acqd/.venv/bin/acqd"
