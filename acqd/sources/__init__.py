"""Where samples come from. One small base, one module per kind."""

from acqd.sources.base import Source
from acqd.sources.load import load_waveform
from acqd.sources.replay import ReplaySource
from acqd.sources.simulated import SimulatedSource, SimulationSettings
from acqd.sources.waveform import ChannelMap, Waveform

__all__ = [
    "ChannelMap",
    "ReplaySource",
    "SimulatedSource",
    "SimulationSettings",
    "Source",
    "Waveform",
    "load_waveform",
]
