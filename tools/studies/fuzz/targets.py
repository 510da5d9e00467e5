"""The parsers of acqd that read what others have written, each with small valid inputs to start from."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from acqd.errors import UserError
from tools.studies.fuzz import seeds
from tools.studies.fuzz.mutate import Files


@dataclass(frozen=True, slots=True)
class Target:
    """One parser."""

    name: str
    seeds: Callable[[], list[Files]]
    read: Callable[[Path], object]
    """Parses the files in a folder, whose names are those of the seeds."""
    refusals: tuple[type[Exception], ...] = ()
    """Exceptions besides UserError by which this parser refuses input, with one line."""

    def run(self, files: Files) -> None:
        """Raises whatever the parser raises."""
        with tempfile.TemporaryDirectory(prefix="acqd-fuzz-", dir=_memory()) as folder:
            for name, content in files.items():
                (Path(folder) / name).write_bytes(content)
            self.read(Path(folder))


@cache
def _memory() -> str | None:
    """A folder in memory, where there is one: a million inputs would wear out a disk."""
    return "/dev/shm" if Path("/dev/shm").is_dir() else None


def _waveform(name: str, **options: Any) -> Callable[[Path], object]:
    def read(folder: Path) -> object:
        from acqd.metering import Meter, SampleBlock
        from acqd.metering.quality.detector import EventDetector
        from acqd.metering.quality.reference import Declared
        from acqd.sources import ChannelMap, load_waveform
        from acqd.timestamps import filetime, rfc3339

        waveform = load_waveform(folder / name, ChannelMap(**options))
        start = waveform.start_utc_ns or 0
        rfc3339(start), filetime(start)  # what is accepted must be fit for the next step
        block = SampleBlock(waveform.codes[:_METERED], 0, start)
        events = EventDetector(waveform.form, Declared(230.0))
        return Meter(waveform.form).feed(block), [*events.feed(block), *events.finish()]

    return read


def _row(folder: Path) -> object:
    from acqd.telemetry.row import parse_row

    return parse_row((folder / "row.json").read_bytes())


def _event(folder: Path) -> object:
    from acqd.telemetry.event import parse_event

    return parse_event((folder / "event.json").read_bytes())


def _receipt(folder: Path) -> object:
    from acqd.telemetry.receipts import parse_receipt, ranges_of

    return ranges_of("box", parse_receipt((folder / "receipt.json").read_bytes()))


def _name(folder: Path) -> object:
    """What a daemon hears of another one of its name, which has to decide who publishes."""
    from acqd.telemetry.ask import Claimant
    from acqd.telemetry.last_rows import LastRows
    from acqd.telemetry.name import Name

    payload = (folder / "heard.json").read_bytes()
    name, last = Name(Claimant("a", "b", "c", "2026")), LastRows({"box": "b"})
    name.heard_status(payload, retained=False)
    name.heard_ask(payload)
    last.heard_summary("acqd/box/L1/summary", payload)
    return name


def _config(folder: Path) -> object:
    from acqd.daemon.config_file import load_config

    config = load_config(folder / "acqd.toml")
    specification = getattr(config.source, "spec", None)  # meters have none
    return specification and specification(), config.sink.settings(), config.mqtt.uses_tls


@cache
def _ur10e() -> Any:
    """A description takes longer to read than a log."""
    from acqd.robot import load_description

    return load_description("ur10e")


def _log(folder: Path) -> object:
    from acqd.sidecar.log_file import open_log

    path = folder / "robot.log"
    robot = _ur10e()
    with path.open("rb") as file:
        return list(open_log(path, file, robot, robot.axes).pieces(0.5))


def _table(folder: Path) -> object:
    from acqd.robot.table import read_table

    return read_table(folder / "robot.csv", 0.01)


def _bundle(folder: Path) -> object:
    from acqd.models.bundle.envelope import Envelope
    from acqd.models.bundle.restore import open_model

    bundle, model = open_model(folder)
    return Envelope.from_json(bundle.metadata["envelope"]) if "envelope" in bundle.metadata else model


def _power(folder: Path) -> object:
    from acqd.dataset.power import open_power

    return [open_power(str(path), None, None) for path in folder.iterdir()]


def _robot(folder: Path) -> object:
    from acqd.robot.description import load_description

    return load_description(str(folder / "robot.toml"))


def _urdf(folder: Path) -> object:
    from acqd.robot.urdf.document import read_urdf

    return read_urdf(folder / "robot.urdf")


def _profile(folder: Path) -> object:
    from acqd.sources.meters.profile import load_profile

    return load_profile(str(folder / "meter.toml"))


def _sampled_values(folder: Path) -> object:
    from acqd.sources.sampled_values.frame import FrameError, parse

    try:
        return parse((folder / "frame.bin").read_bytes())
    except FrameError as error:
        raise UserError(str(error)) from None


def _live(folder: Path) -> object:
    from acqd.sidecar.live import Live

    live = Live(seeds.grey_box(), "a", "b")
    live.answer((folder / "joints.json").read_bytes())
    if live.refused:
        raise UserError("refused and counted")
    return live


_METERED = 2000  # samples
_VALUE_ERROR = (ValueError,)
_SCALES = {"u_scale": 400.0, "i_scale": 10.0}
TARGETS: tuple[Target, ...] = (
    Target("csv", seeds.csv_waveforms, _waveform("a.csv")),
    Target("csv-rate", seeds.csv_waveforms, _waveform("a.csv", rate=20_000.0, columns={"u1": "1", "i1": "2"})),
    Target("npz", seeds.npz_waveforms, _waveform("a.npz")),
    Target("wav", seeds.wav_waveforms, _waveform("a.wav", **_SCALES)),
    Target("flac", seeds.flac_waveforms, _waveform("a.flac", **_SCALES)),
    Target("comtrade", seeds.comtrade_waveforms, _waveform("a.cfg")),
    Target("comtrade-cff", seeds.cff_waveforms, _waveform("a.cff")),
    Target("mat", seeds.mat_waveforms, _waveform("a.mat")),
    Target("hdf5", seeds.hdf5_waveforms, _waveform("a.h5")),
    Target("parquet", seeds.parquet_waveforms, _waveform("a.parquet")),
    Target("arrow", seeds.arrow_waveforms, _waveform("a.arrow")),
    Target("tdms", seeds.tdms_waveforms, _waveform("a.tdms")),
    Target("trc", seeds.trc_waveforms, _waveform("C1a.trc")),
    Target("isf", seeds.isf_waveforms, _waveform("a_CH1.isf")),
    Target("wfm", seeds.wfm_waveforms, _waveform("a_CH1.wfm")),
    Target("row", seeds.rows, _row, _VALUE_ERROR),
    Target("event", seeds.events, _event, _VALUE_ERROR),
    Target("receipt", seeds.receipts, _receipt, _VALUE_ERROR),
    Target("name", seeds.asks, _name),
    Target("config", seeds.configurations, _config),
    Target("log", seeds.logs, _log),
    Target("table", seeds.tables, _table),
    Target("bundle", seeds.bundles, _bundle),
    Target("power-csv", seeds.power_csv, _power),
    Target("power-jsonl", seeds.power_json_lines, _power),
    Target("power-parquet", seeds.power_parquet, _power),
    Target("robot", seeds.robots, _robot),
    Target("urdf", seeds.urdf, _urdf),
    Target("meter-profile", seeds.profiles, _profile),
    Target("sampled-values", seeds.sampled_values, _sampled_values),
    Target("joints", seeds.joints, _live),
)


def target(name: str) -> Target:
    """The parser of a name. Raises KeyError."""
    return {one.name: one for one in TARGETS}[name]
