"""The parsers of acqd that read what others have written, each with small valid inputs to start from."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from acqd.errors import UserError
from tools.studies.fuzz.mutate import Files
from tools.studies.fuzz.seeds import descriptions, messages, motion, power, waveforms


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
        folder = _folder()
        for path in folder.iterdir():
            if path.name not in files:
                path.unlink()
        for name, content in files.items():
            (folder / name).write_bytes(content)
        self.read(folder)


@cache
def _folder() -> Path:
    """Where this process writes its inputs; in memory, where that is possible: a million would wear out a disk."""
    memory = Path("/dev/shm")
    folder = Path(tempfile.mkdtemp(prefix="acqd-fuzz-", dir=memory if memory.is_dir() else None))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


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

    live = Live(motion.grey_box(), "a", "b")
    live.answer((folder / "joints.json").read_bytes())
    if live.refused:
        raise UserError("refused and counted")
    return live


_METERED = 2000  # samples
_VALUE_ERROR = (ValueError,)
_SCALES = {"u_scale": 400.0, "i_scale": 10.0}
TARGETS: tuple[Target, ...] = (
    Target("csv", waveforms.csv_waveforms, _waveform("a.csv")),
    Target("csv-rate", waveforms.csv_waveforms, _waveform("a.csv", rate=20_000.0, columns={"u1": "1", "i1": "2"})),
    Target("npz", waveforms.npz_waveforms, _waveform("a.npz")),
    Target("wav", waveforms.wav_waveforms, _waveform("a.wav", **_SCALES)),
    Target("flac", waveforms.flac_waveforms, _waveform("a.flac", **_SCALES)),
    Target("comtrade", waveforms.comtrade_waveforms, _waveform("a.cfg")),
    Target("comtrade-cff", waveforms.cff_waveforms, _waveform("a.cff")),
    Target("mat", waveforms.mat_waveforms, _waveform("a.mat")),
    Target("hdf5", waveforms.hdf5_waveforms, _waveform("a.h5")),
    Target("parquet", waveforms.parquet_waveforms, _waveform("a.parquet")),
    Target("arrow", waveforms.arrow_waveforms, _waveform("a.arrow")),
    Target("tdms", waveforms.tdms_waveforms, _waveform("a.tdms")),
    Target("trc", waveforms.trc_waveforms, _waveform("C1a.trc")),
    Target("isf", waveforms.isf_waveforms, _waveform("a_CH1.isf")),
    Target("wfm", waveforms.wfm_waveforms, _waveform("a_CH1.wfm")),
    Target("row", messages.rows, _row, _VALUE_ERROR),
    Target("event", messages.events, _event, _VALUE_ERROR),
    Target("receipt", messages.receipts, _receipt, _VALUE_ERROR),
    Target("name", messages.asks, _name),
    Target("config", descriptions.configurations, _config),
    Target("log", motion.logs, _log),
    Target("table", motion.tables, _table),
    Target("bundle", motion.bundles, _bundle),
    Target("power-csv", power.power_csv, _power),
    Target("power-jsonl", power.power_json_lines, _power),
    Target("power-parquet", power.power_parquet, _power),
    Target("robot", descriptions.robots, _robot),
    Target("urdf", descriptions.urdf, _urdf),
    Target("meter-profile", descriptions.profiles, _profile),
    Target("sampled-values", messages.sampled_values, _sampled_values),
    Target("joints", messages.joints, _live),
)


def target(name: str) -> Target:
    """The parser of a name. Raises KeyError."""
    return {one.name: one for one in TARGETS}[name]
