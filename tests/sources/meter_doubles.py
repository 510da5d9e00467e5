"""Doubles of RMS meters whose values do not move."""

from __future__ import annotations

from acqd.sources.meters import MeterBus, MeterSettings, Reading
from acqd.sources.modbus import ModbusLink
from tests.doubles.modbus import ModbusTcpDouble, RmsMeter
from tests.waiting import wait_for

MODELS = {"sdm120": "sdm120", "sdm630": "sdm630", "sdm72": "sdm72", "em340": "em340", "b23": "b23",
          "iem3155": "iem3155", "shelly_pro_3em": "pro3em"}  # fmt: skip
"""acqd's profile -> the double's model, whose registers come from another pen."""


def frozen(model: str, **changes: object) -> RmsMeter:
    """A meter whose values do not move, so that a reading can be compared with them."""
    return RmsMeter(model, clock=lambda: 1000.0, **changes)  # type: ignore[arg-type]


def read_once(bank: RmsMeter, profile: str, **changes: object) -> Reading:
    with ModbusTcpDouble({1: bank}) as double:
        meter = MeterSettings("m", profile, unit=1, **changes)  # type: ignore[arg-type]
        bus = MeterBus(ModbusLink("127.0.0.1", double.port, timeout_s=10.0), [meter])
        got: list[Reading] = []
        bus.check()
        bus.start(got.append)
        wait_for(lambda: got, "a reading")
        bus.stop()
    return got[0]


def meant(values: dict[str, float]) -> dict[str, float]:
    """The double's names -> ours."""
    names = {"U": "Vrms", "I": "Irms", "P": "P", "S": "S", "PF": "PF"}
    found = {}
    for key, value in values.items():
        kind, phase = key.rstrip("123"), key[len(key.rstrip("123")) :]
        if key in ("import_kwh", "export_kwh"):
            found["total.W" if key == "import_kwh" else "total.W_export"] = value
        elif key == "f":
            found["f"] = value
        else:
            found[f"{f'L{phase}' if phase else 'total'}.{names[kind]}"] = value
    return found
