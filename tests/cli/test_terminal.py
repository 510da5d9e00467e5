"""What the terminal shows, without processes."""

import io

import orjson
import pytest
from rich.console import Console

from acqd.cli.sparkline import sparkline
from acqd.cli.table import energy, power_table
from acqd.cli.watched import Watched
from tests.commands import acqd_here, refused


def summary(channel, P=180.0, device="acqd"):
    """A summary with every value as wide as it gets in a workshop."""
    values = {"Vrms": 230.12, "Irms": 15.123, "P": P, "S": 3471.5, "PF": -0.912, "f": 49.987, "W": 1.23456}
    return {"device": device, "channel": channel, "time": "2026-11-22T10:00:00Z", "flags": ["simulated"], **values}


def shown(renderable):
    console = Console(width=80, file=io.StringIO())
    console.print(renderable)
    return console.file.getvalue()


@pytest.mark.parametrize("traces", [None, {("acqd", "L1"): "▁▂▃▄▅▆▇█▇▆▅▄"}])
def test_the_live_table_shows_every_digit_in_80_columns(traces):
    rows = {("acqd", channel): summary(channel, -3164.2) for channel in ("L1", "L2", "L3", "total")}
    rows["acqd", "L1"]["flags"] = ["late", "simulated"]
    text = shown(power_table(rows, "acqd run", traces))
    assert "…" not in text and max(map(len, text.splitlines())) <= 80
    values = ["230.1", "15.123", "-3164.2", "-0.912", "49.987", "1.2346 kWh"] + ([] if traces else ["3471.5"])
    assert all(text.count(value) == 4 for value in values) and text.count("simulated") == 1 and text.count(" late") == 1


def test_two_devices_are_named():
    text = shown(power_table({(d, "L1"): summary("L1", device=d) for d in ("cell-1", "cell-2")}, ""))
    assert "cell-1" in text and "cell-2" in text


@pytest.mark.parametrize(
    ("kwh", "text"), [(2.5e-7, "0 mWh"), (-4.4e-4, "-440 mWh"), (0.0123, "12.300 Wh"), (4.5, "4.5000 kWh"),
                      (12_345.6, "12.3456 MWh"), (None, "-")],
)  # fmt: skip
def test_energies_have_the_prefix_that_suits_them(kwh, text):
    assert energy(kwh) == text


def test_a_sparkline_spans_its_values():
    assert sparkline([]) == "" and sparkline([5, 5]) == "▁▁"
    assert sparkline(range(8)) == "▁▂▃▄▅▆▇█" and len(sparkline(range(60))) == 12


def test_watch_says_what_it_waits_for_and_how_the_daemon_is():
    watched = Watched("127.0.0.1:1883")
    assert "connecting to 127.0.0.1:1883" in shown(watched.table())
    watched.connected()
    assert "waiting for rows" in shown(watched.table())
    assert watched.take("acqd/acqd/L1/summary", orjson.dumps(summary("L1")))
    assert not watched.take("acqd/acqd/L1/summary", b"something else")
    assert watched.take("acqd/acqd/status", b"offline")
    assert watched.take("acqd/acqd/prediction/live", b'{"P_predicted": 181.25}')
    text = shown(watched.table())
    assert "acqd: offline; predicted 181.2 W" in text and "waiting" not in text
    watched.lost("connection refused")
    assert "connection refused; connecting again" in shown(watched.table())


def test_config_init_writes_a_file_that_the_daemon_takes(tmp_path):
    done = acqd_here("config", "init", cwd=tmp_path)
    assert done.returncode == 0 and "acqd run --config acqd.toml" in done.stdout
    assert "exists" in refused(acqd_here("config", "init", cwd=tmp_path))
    from acqd.daemon.config import Config
    from acqd.daemon.config_file import load_config

    assert load_config(tmp_path / "acqd.toml").model_dump(exclude={"state_dir"}) == Config().model_dump(
        exclude={"state_dir"}
    )


def test_version_and_options_without_a_config(tmp_path):
    assert acqd_here("--version", cwd=tmp_path).stdout.startswith("acqd ")
    assert "--device" in refused(acqd_here("run", "--device", "a/b", cwd=tmp_path))
    (tmp_path / "c.toml").write_text("")
    assert "--database" in refused(acqd_here("run", "--config", "c.toml", "--database", "x", cwd=tmp_path))
