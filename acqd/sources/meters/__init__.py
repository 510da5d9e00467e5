"""RMS meters read over Modbus: no waveforms, readings straight from registers."""

from acqd.sources.meters.bus import MeterBus, MeterSettings
from acqd.sources.meters.profile import Profile, known_profiles, load_profile
from acqd.sources.meters.reading import Reading

__all__ = ["MeterBus", "MeterSettings", "Profile", "Reading", "known_profiles", "load_profile"]
