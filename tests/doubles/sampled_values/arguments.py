"""Command line of the double."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from tests.doubles.sampled_values.recording import RecordedWave
from tests.doubles.sampled_values.replay import Replay
from tests.doubles.sampled_values.stream import DESTINATION, USUAL_ASDUS, SvStream
from tests.doubles.sampled_values.unit import FrameSource
from tests.doubles.sampled_values.wave import SvWave, Wave


def parsed(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The options; exits with a message for wrong ones."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.doubles.sampled_values", description="Publishes IEC 61850-9-2 sampled values."
    )
    parser.add_argument("--interface", required=True, help="interface that the frames leave on")
    parser.add_argument("--rate", type=int, default=4800, help="samples a second")
    parser.add_argument("--asdus", type=int, help="samples a frame; without it the usual number at the rate")
    parser.add_argument("--svid", action="append", help="once for each stream")
    parser.add_argument("--appid", type=lambda text: int(text, 0), default=0x4000, help="of the first stream")
    parser.add_argument("--streams", type=int, default=1, help="streams on the wire; each has its own noise")
    parser.add_argument("--clock", choices=["real", "burst"], default="real")
    parser.add_argument("--autostart", action="store_true", help="send without waiting for the command start")
    parser.add_argument("--pcap", type=Path, help="replay the frames of this capture instead")
    parser.add_argument("--recording", type=Path, help="send the values of this export (module recording)")
    _add_waveform(parser)
    _add_frame(parser)
    return parser.parse_args(arguments)


def _add_waveform(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--phases", type=int, choices=[1, 2, 3], default=3)
    parser.add_argument("--f", type=float, default=50.0, help="Hz")
    parser.add_argument("--volts", type=float, default=10e3 / 3**0.5, help="rms, primary, phase to neutral")
    parser.add_argument("--amperes", type=float, default=40.0, help="rms, primary")
    parser.add_argument("--drift-ppm", type=float, default=0.0, help="error of the unit's clock; positive is fast")


def _add_frame(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--prp", action="store_true", help="frames end with the trailer of a redundant network")
    parser.add_argument("--vlan", type=int, help="VLAN identifier; without it the frames have no tag")
    parser.add_argument("--layout", default="I4U4", help="currents and voltages of a sample")
    parser.add_argument("--dat-set", help="send datSet")
    parser.add_argument("--refr-tm", action="store_true", help="send refrTm")
    parser.add_argument("--smp-rate", action="store_true", help="send smpRate")
    parser.add_argument("--smp-mod", type=int, help="send smpMod: 0 samples a period, 1 samples a second")
    parser.add_argument("--long-lengths", type=int, default=0, help="octets of each BER length in the long form")
    parser.add_argument("--first-count", type=int, default=0, help="smpCnt of the first sample")


def sources(options: argparse.Namespace) -> list[FrameSource]:
    """The streams that the options ask for. Raises ValueError or OSError as `SvStream`, `Replay`, `RecordedWave`."""
    if options.pcap is not None:
        return [Replay(options.pcap)]
    return [_stream(options, number) for number in range(options.streams)]


def _stream(options: argparse.Namespace, number: int) -> SvStream:
    """Stream 0, 1, ...: addresses count on from the first."""
    return SvStream(
        rate=options.rate,
        asdus=options.asdus or USUAL_ASDUS.get(options.rate, 1),
        svid=_svid(options.svid or ["MU0101"], number),
        appid=options.appid + number,
        vlan=options.vlan,
        prp=options.prp,
        wave=_wave(options, number),
        layout=options.layout,
        dat_set=options.dat_set,
        refr_tm=options.refr_tm,
        smp_rate=options.smp_rate,
        smp_mod=options.smp_mod,
        long_lengths=options.long_lengths,
        first_count=options.first_count,
        destination=(int.from_bytes(DESTINATION, "big") + number).to_bytes(6, "big"),
        drift_ppm=options.drift_ppm,
    )


def _svid(names: list[str], number: int) -> str:
    """The name given for the stream, or the first name with the stream's number: "MU0101-2"."""
    return names[number] if number < len(names) else f"{names[0]}-{number + 1}"


def _wave(options: argparse.Namespace, number: int) -> Wave:
    if options.recording is not None:
        if options.rate != RecordedWave.rate:
            raise ValueError(f"The recording has {RecordedWave.rate:g} samples/s, not {options.rate}")
        return RecordedWave(options.recording)
    return SvWave(
        options.rate, options.phases, f=options.f, volts=options.volts, amperes=options.amperes, seed=1 + number
    )
