"""Which profile fits a device on a link? Identity and plausibility of every profile, best first."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from acqd.errors import UserError
from acqd.sources.meters.access import MeterAccess
from acqd.sources.meters.decode import raw_value
from acqd.sources.meters.plausible import decode, explain, judge
from acqd.sources.meters.profile import Profile, known_profiles, load_profile
from acqd.sources.modbus.client import ModbusClient, ModbusError, NoConnectionError
from acqd.sources.modbus.registers import HEADER_REGISTERS, MapError, parse_layout
from acqd.sources.modbus.settings import ModbusLink


@dataclass(frozen=True, slots=True)
class Candidate:
    """How one profile fits one unit."""

    unit: int
    profile: str
    fits: bool
    """The registers answer and agree with each other."""
    identified: bool | None
    """Whether the identification registers name this model; None: the profile knows none, or they do not answer."""
    checks: int
    """Relations between quantities that hold."""
    values: dict[str, float | None]
    remark: str
    missing: int = 0
    """Registers of the profile that the unit does not have."""

    @property
    def rank(self) -> tuple[bool, bool, bool, int]:
        """Larger is better."""
        return self.fits and self.identified is not False, self.identified is True, not self.missing, self.checks


def probe(
    link: ModbusLink, units: Iterable[int], nominal_voltage: float, progress: Callable[[int], None]
) -> Iterator[Candidate]:
    """Every profile against every unit that answers; nothing is written to any register."""
    client = ModbusClient(link)
    try:
        for unit in units:
            if _answers(client, unit):
                bridge = _bridge(client, unit)
                if bridge is not None:
                    yield bridge
                for name in known_profiles():
                    yield _try(client, unit, load_profile(name), nominal_voltage)
            progress(unit)
    finally:
        client.close()


def _answers(client: ModbusClient, unit: int) -> bool:
    """Any answer counts, an exception too: somebody is there."""
    try:
        client.read(unit, [(3, 0, 1)])
    except NoConnectionError as error:
        raise UserError(f"{client.link}: {error}") from None
    except ModbusError as error:
        return error.code is not None and error.code < 10
    return True


def _bridge(client: ModbusClient, unit: int) -> Candidate | None:
    try:
        [data] = client.read(unit, [(3, 0, HEADER_REGISTERS)])
        layout = parse_layout(data)
    except (ModbusError, MapError):
        return None
    remark = f'{layout.channels // 2} phases at {layout.rate:g} Hz: use kind = "modbus"'
    return Candidate(unit, "waveform bridge", True, True, 1, {}, remark)


def _try(client: ModbusClient, unit: int, profile: Profile, nominal_voltage: float) -> Candidate:
    identified = _identified(client, unit, profile)
    access = MeterAccess(unit, profile)
    try:
        answers = access.read(client)
    except ModbusError as error:
        return Candidate(unit, profile.name, False, identified, 0, {}, str(error))
    missing = len(profile.quantities) - len(access.profile.quantities)
    profile, plan = access.profile, access.plan
    values = decode(profile, plan, answers)
    verdict = judge(profile, values, nominal_voltage)
    if not verdict.judged:
        return Candidate(unit, profile.name, False, identified, 0, values, "no voltage: nothing can be judged")
    remark = f"{missing} of its registers are not there" if missing else ""
    if verdict.faults:
        advice = explain(profile, plan, answers, nominal_voltage)
        remark = f"{verdict.faults[0]}; {advice}" if advice else verdict.faults[0]
    return Candidate(unit, profile.name, not verdict.faults, identified, verdict.checks, values, remark, missing)


def _identified(client: ModbusClient, unit: int, profile: Profile) -> bool | None:
    identity = profile.identity
    if identity is None:
        return None
    register = identity.register
    try:
        [data] = client.read(unit, [(register.function, register.address, register.width)])
    except ModbusError:
        return None
    return raw_value(register, data) in identity.values
