"""Pure numerics: 20 kHz blocks in, electrical quantities out. No I/O, no clock, no logging."""

from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.meter import Meter, Mode
from acqd.metering.window import WindowBatch

__all__ = ["Meter", "Mode", "SampleBlock", "StreamFormat", "WindowBatch"]
