"""A waveform bridge: sampled blocks in a ring of Modbus registers, read through pymodbus."""

from acqd.sources.modbus.settings import BridgeSettings, ModbusLink
from acqd.sources.modbus.source import BridgeSource

__all__ = ["BridgeSettings", "BridgeSource", "ModbusLink"]
