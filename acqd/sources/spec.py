"""A source as plain JSON, so that another process can make it."""

from __future__ import annotations

from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import Any

from acqd.errors import UserError
from acqd.extras import install_command
from acqd.sources.base import Source
from acqd.sources.load import load_waveform
from acqd.sources.replay import ReplaySource
from acqd.sources.simulated import Sag, SimulatedSource, SimulationSettings
from acqd.sources.waveform import ChannelMap

Spec = dict[str, Any]
_EXTRA = "hw"


def simulated_spec(settings: SimulationSettings) -> Spec:
    """The spec of a SimulatedSource."""
    plain = asdict(settings)
    plain["load_profile"] = str(settings.load_profile) if settings.load_profile else None
    return {"kind": "simulated", "settings": plain}


def replay_spec(path: Path, channels: ChannelMap, loops: int) -> Spec:
    """The spec of a ReplaySource."""
    return {"kind": "replay", "path": str(path), "channels": asdict(channels), "loops": loops}


def spec_of(kind: str, *, simulated: bool = False, **settings: Any) -> Spec:
    """The spec of a device: `kind` and the fields of its settings. `simulated` flags every row."""
    return {"kind": kind, "simulated": simulated, "settings": settings}


def make_source(spec: Spec) -> Source:
    """The source a spec describes. Raises UserError for a file, or an installation, that cannot be used."""
    makers = {"simulated": _simulated, "replay": _replay, "modbus": _modbus}
    source = makers.get(spec["kind"], _device)(spec)
    if "period_ms" in spec:
        source.period_ns = spec["period_ms"] * 1_000_000
    if spec.get("simulated"):
        source.flags |= {"simulated"}
    return source


def _replay(spec: Spec) -> Source:
    waveform = load_waveform(Path(spec["path"]), ChannelMap(**spec["channels"]))
    return ReplaySource(waveform, spec["loops"])


def _simulated(spec: Spec) -> Source:
    plain = dict(spec["settings"])
    plain["sags"] = tuple(Sag(**sag) for sag in plain["sags"])
    for name in ("harmonics", "current_harmonics"):
        plain[name] = {int(order): share for order, share in plain[name].items()}
    plain["load_profile"] = Path(plain["load_profile"]) if plain["load_profile"] else None
    return SimulatedSource(SimulationSettings(**plain))


_DEVICES = {
    "ethercat": ("ethercat", "EthercatSettings", "EthercatSource"),
    "ads": ("ads", "AdsSettings", "AdsSource"),
    "sampled-values": ("sampled_values", "SampledValuesSettings", "SampledValuesSource"),
}


def _device(spec: Spec) -> Source:
    package, settings, source = _DEVICES[spec["kind"]]
    module = device_module(package)
    # JSON has no tuples; the settings are frozen.
    values = {name: tuple(value) if isinstance(value, list) else value for name, value in spec["settings"].items()}
    made: Source = getattr(module, source)(getattr(module, settings)(**values))
    return made


def _modbus(spec: Spec) -> Source:
    module = device_module("modbus")
    values = dict(spec["settings"])
    made: Source = module.BridgeSource(module.BridgeSettings(link=module.ModbusLink(**values.pop("link")), **values))
    return made


def device_module(package: str) -> Any:
    """A package of acqd.sources that needs the hardware libraries. Raises UserError where they are not installed."""
    try:
        return import_module(f"acqd.sources.{package}")
    except ModuleNotFoundError as error:
        raise UserError(
            f"source.kind: {error.name} is not installed; {install_command(_EXTRA)} (make install EXTRA={_EXTRA})"
        ) from None
