"""Modbus servers with wire code of their own: Modbus TCP, RTU on a pty, a waveform bridge and meters."""

from __future__ import annotations

from tests.doubles.modbus.bank import ModbusFault, PlainBank, RegisterBank
from tests.doubles.modbus.base import ModbusDouble
from tests.doubles.modbus.bridge import WaveformBridge
from tests.doubles.modbus.control import ModbusProcess
from tests.doubles.modbus.meter import RmsMeter
from tests.doubles.modbus.rtu import ModbusRtuDouble
from tests.doubles.modbus.tcp import ModbusTcpDouble

__all__ = [
    "ModbusDouble",
    "ModbusFault",
    "ModbusProcess",
    "ModbusRtuDouble",
    "ModbusTcpDouble",
    "PlainBank",
    "RegisterBank",
    "RmsMeter",
    "WaveformBridge",
]
