"""A source as plain JSON, so that another process can make it."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from acqd.sources.base import Source
from acqd.sources.load import load_waveform
from acqd.sources.replay import ReplaySource
from acqd.sources.simulated import Sag, SimulatedSource, SimulationSettings
from acqd.sources.waveform import ChannelMap

Spec = dict[str, Any]


def simulated_spec(settings: SimulationSettings) -> Spec:
    """The spec of a SimulatedSource."""
    plain = asdict(settings)
    plain["load_profile"] = str(settings.load_profile) if settings.load_profile else None
    return {"kind": "simulated", "settings": plain}


def replay_spec(path: Path, channels: ChannelMap, loops: int) -> Spec:
    """The spec of a ReplaySource."""
    return {"kind": "replay", "path": str(path), "channels": asdict(channels), "loops": loops}


def make_source(spec: Spec) -> Source:
    """The source a spec describes. Raises InputError for files that cannot be used."""
    if spec["kind"] == "replay":
        waveform = load_waveform(Path(spec["path"]), ChannelMap(**spec["channels"]))
        return ReplaySource(waveform, spec["loops"])
    plain = dict(spec["settings"])
    plain["sags"] = tuple(Sag(**sag) for sag in plain["sags"])
    for name in ("harmonics", "current_harmonics"):
        plain[name] = {int(order): share for order, share in plain[name].items()}
    plain["load_profile"] = Path(plain["load_profile"]) if plain["load_profile"] else None
    return SimulatedSource(SimulationSettings(**plain))
