"""`acqd service` below a root folder, and its broker and units with the real programs."""

from __future__ import annotations

import asyncio
import errno
import json
import os
import re
import shutil
import stat
import subprocess

import aiomqtt
import pytest

from acqd.daemon.config_file import load_config
from acqd.installation.broker_access import password_line
from acqd.installation.plan import LOGINS, SERVICES
from tests.commands import acqd_here, refused
from tests.installation.roots import NEEDS, contents, installed

pytestmark = NEEDS


def test_an_installation_has_user_folders_units_and_access(root):
    wanted = ("--device", "hall-3", "--rights", "raw-network", "--archive", "/srv/waveforms")
    installed(root, *wanted, "--with", "daemon", "--with", "sink")
    files = contents(root)
    assert b"ReadWritePaths=-/srv/waveforms\n" in files["/etc/systemd/system/acqd.service.d/archive.conf"][0]
    assert stat.S_IMODE((root / "srv/waveforms").stat().st_mode) == 0o750
    kept = load_config(root / "etc/acqd/acqd.toml").archive
    assert kept.enabled and str(kept.folder) == "/srv/waveforms"
    assert re.search(r"^acqd:x:\d+:\d+:acqd power metering:/var/lib/acqd:", files["/etc/passwd"][0].decode(), re.M)
    group = int(re.search(r"^acqd:x:(\d+):", files["/etc/group"][0].decode(), re.M)[1])
    for folder, mode in (("etc/acqd", 0o750), ("var/lib/acqd", 0o750)):
        status = (root / folder).stat()
        assert stat.S_IMODE(status.st_mode) == mode and status.st_gid == group
    assert files["/etc/acqd/acqd.toml"][1:] == (0o640, group)
    assert files["/etc/acqd/hall-3.password"][1] == files["/etc/acqd/acqd-sink.password"][1] == 0o600
    assert files["/etc/mosquitto/acqd.passwords"][1:] == (0o640, 117)
    assert b"CAP_NET_RAW" in files["/etc/systemd/system/acqd.service.d/raw-network.conf"][0]
    assert b"ExecStart=/bin/true run --config /etc/acqd/acqd.toml" in files["/etc/systemd/system/acqd.service"][0]
    assert "/etc/systemd/system/acqd-sidecar.service" not in files
    settings = load_config(root / "etc/acqd/acqd.toml")
    assert settings.device == settings.mqtt.username == "hall-3"


def test_every_service_logs_in_as_a_user_that_the_access_rules_know(root):
    installed(root, "--with", "all")
    rules = (root / "etc/mosquitto/acqd.acl").read_text()
    for name, service in SERVICES.items():
        unit = next(unit for unit in service.units if unit.endswith(".service"))
        user = LOGINS.get(service.login, "box")
        drop_in = (root / f"etc/systemd/system/{unit}.d/password.conf").read_text()
        assert f"LoadCredential=mqtt.password:/etc/acqd/{user}.password\n" in drop_in
        address = load_config(root / "etc/acqd/acqd.toml", service.login).mqtt.address()
        assert (address.username, address.password) == (user, (root / f"etc/acqd/{user}.password").read_text().strip())
        assert "--config /etc/acqd/acqd.toml" in (root / f"etc/systemd/system/{unit}").read_text(), name
        assert f"user {user}\n" in rules or user == "box"  # a device's rules are a pattern of its name
        assert f"{user}:$7$" in (root / "etc/mosquitto/acqd.passwords").read_text()


def test_a_second_installation_changes_nothing(root):
    installed(root)
    (root / "etc/acqd/acqd.toml").write_text('device = "mine"\n')
    before = contents(root)
    assert installed(root) == "nothing to do\n"
    assert contents(root) == before
    (root / "etc/systemd/system/acqd.service").write_text("of an earlier version")
    assert installed(root) == "wrote /etc/systemd/system/acqd.service\n"
    assert contents(root) == before
    (root / "etc/mosquitto/acqd.acl").write_text("of an earlier version")
    assert installed(root).startswith("kept /etc/mosquitto/acqd.acl, which differs")


def test_removal_keeps_rows_and_configuration_unless_purged(root):
    before = contents(root)
    installed(root, "--rights", "serial", "--with", "all")
    (root / "var/lib/acqd/acqd.sqlite").write_text("rows")
    assert acqd_here("service", "remove", "--root", root).returncode == 0
    left = set(contents(root)) - set(before)
    assert left == {
        "/etc/passwd", "/etc/shadow", "/etc/gshadow", "/var/lib/acqd/acqd.sqlite",
        "/etc/acqd/acqd.toml", *(f"/etc/acqd/{user}.password" for user in ("box", *LOGINS.values())),
    }  # fmt: skip
    assert not list((root / "etc/systemd/system").iterdir())
    refusal = refused(acqd_here("service", "remove", "--purge", "--root", root))
    assert "--purge deletes /var/lib/acqd, " in refusal and "--yes goes on" in refusal
    assert (root / "var/lib/acqd/acqd.sqlite").read_text() == "rows"
    assert acqd_here("service", "remove", "--purge", "--yes", "--root", root).returncode == 0
    assert set(contents(root)) - set(before) == {"/etc/passwd", "/etc/shadow", "/etc/gshadow"}
    assert b"acqd" not in (root / "etc/passwd").read_bytes() + (root / "etc/group").read_bytes()
    assert acqd_here("service", "remove", "--purge", "--root", root).stdout == "nothing to do\n"


def test_a_purge_that_a_running_process_disturbs_says_so_and_can_be_repeated(root, monkeypatch):
    installed(root)
    (root / "etc/acqd.before-20261127T165033Z").mkdir()
    whole = shutil.rmtree

    def busy(path, *more):
        if str(path).endswith("var/lib/acqd"):
            raise OSError(errno.ENOTEMPTY, os.strerror(errno.ENOTEMPTY), "spool-box")
        whole(path, *more)

    monkeypatch.setattr(shutil, "rmtree", busy)
    done = acqd_here("service", "remove", "--purge", "--yes", "--root", root)
    assert done.returncode == 1 and "/var/lib/acqd cannot be deleted (Directory not empty): " in done.stderr
    assert (root / "etc/acqd/acqd.toml").exists()
    monkeypatch.undo()
    done = acqd_here("service", "remove", "--purge", "--yes", "--root", root)
    assert done.returncode == 0 and not (root / "etc/acqd").exists()
    assert "kept /etc/acqd.before-20261127T165033Z, which a restore has moved aside" in done.stdout


def test_a_purge_deletes_a_link_and_not_what_it_leads_to(root, tmp_path):
    installed(root)
    disk = tmp_path / "disk"
    shutil.move(root / "var/lib/acqd", disk)
    (root / "var/lib/acqd").symlink_to(disk)
    done = acqd_here("service", "remove", "--purge", "--yes", "--root", root)
    assert done.returncode == 0 and f"kept {disk}, to which /var/lib/acqd led" in done.stdout
    assert disk.is_dir() and not (root / "var/lib/acqd").is_symlink() and not (root / "etc/acqd").exists()


def test_an_installation_after_a_removal_lets_the_same_users_in(root):
    installed(root)
    password = (root / "etc/acqd/box.password").read_text()
    users = {line.partition(":")[0] for line in (root / "etc/mosquitto/acqd.passwords").read_text().splitlines()}
    assert acqd_here("service", "remove", "--root", root).returncode == 0
    installed(root)
    again = {line.partition(":")[0] for line in (root / "etc/mosquitto/acqd.passwords").read_text().splitlines()}
    assert users == again == {"box", "acqd-sink", "viewer", "operator"}
    assert (root / "etc/acqd/box.password").read_text() == password


def test_what_cannot_be_installed_is_named(root):
    assert "no service kitchen" in refused(acqd_here("service", "install", "--with", "kitchen", "--root", root))
    assert "no rights all" in refused(acqd_here("service", "install", "--rights", "all", "--root", root))
    assert "letters, digits" in refused(acqd_here("service", "install", "--device", "a/b", "--root", root))
    for folder in ("waveforms", "/srv/a b", "/srv/../etc"):
        assert "absolute path" in refused(acqd_here("service", "install", "--archive", folder, "--root", root))
    assert "does not see" in refused(acqd_here("service", "install", "--archive", "/home/x", "--root", root))
    (root / "etc" / "group").write_text("root:x:0:\n")
    assert "--no-broker" in refused(acqd_here("service", "install", "--root", root))
    assert "nowhere: no such folder" in refused(acqd_here("service", "install", "--root", root / "nowhere"))


def test_systemd_accepts_the_units(root):
    installed(root, "--with", "all", "--rights", "serial")
    units = sorted((root / "etc/systemd/system").glob("acqd*.*e*"))
    units = [path for path in units if path.is_file()]
    assert {path.name for path in units} == {unit for each in SERVICES.values() for unit in each.units}
    bridge = root / "etc/systemd/system/acqd-bridge@influx.service"  # an instance: systemd reads no template
    bridge.write_text((root / "etc/systemd/system/acqd-bridge@.service").read_text())
    units = [bridge if path.name == "acqd-bridge@.service" else path for path in units]
    verified = subprocess.run(["systemd-analyze", "verify", *units], capture_output=True, text=True, check=False)
    complaints = [line for line in verified.stderr.splitlines() if "acqd" in line]
    assert verified.returncode == 0 and not complaints, complaints


def test_mosquitto_grants_what_the_rules_say(root, mosquitto):
    installed(root, "--device", "hall-3")
    mosquitto.stop()
    configuration = (root / "etc/mosquitto/conf.d/acqd.conf").read_text()
    assert "allow_anonymous false" in configuration
    lines = [line for line in configuration.splitlines() if line.startswith(("password_file", "acl_file", "allow"))]
    mosquitto.extra = "\n".join(line.replace(" /etc", f" {root}/etc") for line in lines) + "\n"
    mosquitto.start()
    password = (root / "etc/acqd/hall-3.password").read_text().strip()
    viewer = (root / "etc/acqd/viewer.password").read_text().strip()

    async def seen():
        async with (
            aiomqtt.Client("127.0.0.1", mosquitto.port, username="viewer", password=viewer) as watching,
            aiomqtt.Client("127.0.0.1", mosquitto.port, username="hall-3", password=password) as writing,
        ):
            await watching.subscribe("acqd/#", qos=1)
            for topic in ("acqd/other/L1/power", "acqd/hall-3/L1/power"):
                await writing.publish(topic, b"row", qos=1)
            async for message in watching.messages:
                return str(message.topic)
        return None

    assert asyncio.run(asyncio.wait_for(seen(), 60)) == "acqd/hall-3/L1/power"

    async def stranger():
        async with aiomqtt.Client("127.0.0.1", mosquitto.port, username="hall-3", password="guess"):
            pass

    with pytest.raises(aiomqtt.MqttError):
        asyncio.run(stranger())


def test_passwords_are_salted():
    one, other = password_line("a", "secret"), password_line("a", "secret")
    assert one != other and re.fullmatch(r"a:\$7\$101\$[\w+/=]{16}\$[\w+/=]{88}", one)


def test_a_repeated_installation_keeps_device_services_rights_and_archive(root):
    wanted = ("--device", "hall-3", "--rights", "raw-network", "--archive", "/srv/waveforms")
    installed(root, *wanted, "--with", "daemon", "--with", "web")
    before = contents(root)
    assert installed(root) == installed(root, *wanted) == "nothing to do\n"
    assert contents(root) == before
    for unit in ("acqd", "acqd-web"):  # an update refreshes every unit that is there
        (root / f"etc/systemd/system/{unit}.service").write_text("of an earlier version")
    installed(root)
    assert contents(root) == before
    installed(root, "--with", "sidecar")
    assert "acqd-sidecar:$7$" in (root / "etc/mosquitto/acqd.passwords").read_text()
    assert not (root / "etc/acqd/box.password").exists() and not (root / "etc/acqd/sidecar.toml").exists()
    assert acqd_here("service", "remove", "--root", root).returncode == 0
    installed(root)  # the configuration that is left names the device
    assert "hall-3.password" in (root / "etc/systemd/system/acqd.service.d/password.conf").read_text()


def test_what_contradicts_the_kept_configuration_is_refused_and_changes_nothing(root):
    installed(root, "--device", "hall-3")
    before = contents(root)
    another = refused(acqd_here("service", "install", "--device", "box", "--root", root))
    assert "hall-3 is installed here" in another and "[mqtt] username" in another
    assert "[archive]" in refused(acqd_here("service", "install", "--archive", "/srv/x", "--root", root))
    assert contents(root) == before
    config = root / "etc/acqd/acqd.toml"
    config.write_text(config.read_text().replace('"hall-3"', '"hall-4"'))  # the remedy that the message names
    installed(root, "--device", "hall-4")
    assert "hall-4.password" in (root / "etc/systemd/system/acqd.service.d/password.conf").read_text()
    assert "hall-4:$7$" in (root / "etc/mosquitto/acqd.passwords").read_text()
    config.write_text("device = \n")
    assert "is not valid TOML" in refused(acqd_here("service", "install", "--root", root))


def test_an_installation_without_a_broker_stays_without(root):
    (root / "etc" / "group").write_text("root:x:0:\n")
    installed(root, "--device", "hall-3", "--no-broker")
    assert installed(root) == "nothing to do\n"
    assert acqd_here("service", "remove", "--root", root).returncode == 0
    installed(root)
    assert not (root / "etc/mosquitto").exists() and not list((root / "etc/systemd/system").glob("*.d"))


def test_update_writes_the_units_of_this_version_and_keeps_device_and_credentials(root):
    assert "no service of acqd" in refused(acqd_here("service", "update", "--root", root))
    installed(root, "--device", "hall-3")
    before = contents(root)
    (root / "etc/systemd/system/acqd.service").write_text("of an earlier version")
    done = acqd_here("service", "update", "--root", root, "--program", "/bin/true")
    assert done.stdout == "wrote /etc/systemd/system/acqd.service\n" and contents(root) == before


def test_status_names_unit_file_and_user_of_every_service(root):
    installed(root, "--device", "hall-3", "--with", "daemon", "--with", "web")
    done = acqd_here("service", "status", "--root", root, "--json")
    assert {(one["unit"], one["user"], one["configuration"]) for one in json.loads(done.stdout)} == {
        ("acqd.service", "hall-3", "/etc/acqd/acqd.toml"),
        ("acqd-web.service", "viewer", "/etc/acqd/acqd.toml"),
    }
    assert done.returncode == 0 and "acqd-web.service" in acqd_here("service", "status", "--root", root).stdout
