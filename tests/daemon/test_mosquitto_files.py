"""The configuration of a local mosquitto, found by its process."""

from __future__ import annotations

from acqd.daemon.mosquitto_files import settings_of_local_broker


def process(folder, number, *words):
    (folder / str(number)).mkdir(parents=True)
    (folder / str(number) / "cmdline").write_bytes("\0".join(words).encode() + b"\0")


def test_the_file_of_the_running_broker_is_read_with_what_it_includes(tmp_path):
    more = tmp_path / "conf.d"
    more.mkdir()
    (tmp_path / "m.conf").write_text(f"# set_tcp_nodelay true\npersistence true\ninclude_dir {more}\n")
    process(tmp_path / "proc", 7, "/usr/sbin/mosquitto", "-c", str(tmp_path / "m.conf"))
    process(tmp_path / "proc", 8, "")
    found = settings_of_local_broker(tmp_path / "proc")
    assert found["persistence"] == "true" and "set_tcp_nodelay" not in found
    (more / "a.conf").write_text("set_tcp_nodelay true\n")
    assert settings_of_local_broker(tmp_path / "proc")["set_tcp_nodelay"] == "true"
    usual = tmp_path / "usual.conf"
    usual.write_text("set_tcp_nodelay true\n")
    process(tmp_path / "one", 7, "mosquitto", "-d")
    assert settings_of_local_broker(tmp_path / "one", usual) == {"set_tcp_nodelay": "true"}


def test_nothing_is_said_of_a_broker_that_cannot_be_known(tmp_path):
    assert settings_of_local_broker(tmp_path / "none") is None
    for number in (1, 2):
        process(tmp_path / "two", number, "mosquitto", "-c", "x.conf")
    assert settings_of_local_broker(tmp_path / "two") is None
    process(tmp_path / "unreadable", 1, "mosquitto", "-c", str(tmp_path / "missing.conf"))
    assert settings_of_local_broker(tmp_path / "unreadable") is None
