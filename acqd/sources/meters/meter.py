"""One meter on a bus: identity, plan, plausibility, rounds of readings."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable
from dataclasses import dataclass, replace

from acqd.errors import UserError
from acqd.retry import SHARED_LINE, Backoff
from acqd.sources.meters.access import MeterAccess
from acqd.sources.meters.agreement import EnergyAgreement
from acqd.sources.meters.counter import INVALID
from acqd.sources.meters.decode import raw_value
from acqd.sources.meters.line_voltage import LineVoltage
from acqd.sources.meters.plausible import decode, explain, judge
from acqd.sources.meters.profile import Profile, WordOrder
from acqd.sources.meters.rated import RatedCurrent
from acqd.sources.meters.reading import Reading
from acqd.sources.meters.rounds import Judged, RoundJudge
from acqd.sources.modbus.client import ModbusClient, ModbusError

_log = logging.getLogger(__name__)
_ROUNDS = 3
_STALE_NS = 30_000_000_000
_DEAD = 0.05  # share of the nominal voltage: supply interruption as in EN 50160


@dataclass(frozen=True, slots=True)
class MeterSettings:
    """One meter of the configuration."""

    name: str
    """Device name of its rows."""
    profile: str
    unit: int | None = None
    """Modbus unit id; None: the profile's factory setting."""
    word_order: WordOrder | None = None
    """Where the meter is set to another order than its factory's."""
    poll_s: float | None = None
    """Time between two readings [s]; None: the profile's update time."""
    nominal_voltage: float = 230.0
    """V; what the plausibility check expects."""
    rated_current: float | None = None
    """A; of the fuse in front of the load. It shows a wrong ratio of current transformers."""


class Meter:
    """Reads one meter; remembers whether its registers have been plausible so far."""

    def __init__(self, settings: MeterSettings, profile: Profile) -> None:
        if settings.word_order is not None:
            quantities = {
                name: replace(register, word_order=settings.word_order) for name, register in profile.quantities.items()
            }
            profile = replace(profile, quantities=quantities)
        self.settings = settings
        self.unit = profile.unit if settings.unit is None else settings.unit
        self._access = MeterAccess(self.unit, profile)
        self.period_ns = round((settings.poll_s or profile.update_s) * 1e9)
        self._judge = RoundJudge(settings.nominal_voltage)
        energy = profile.quantities.get("total.W")
        self._agreement = EnergyAgreement(energy.scale if energy else 0.0, profile.phases)
        self._line_voltage, self._rated = LineVoltage(), RatedCurrent(settings.rated_current)
        self._senseless = 0  # rounds in a row without any measurement
        self._trusted = False
        self._backoff = Backoff(SHARED_LINE)
        self._values: dict[str, float | None] = {}
        self._changed_ns = 0
        self._first_due_ns: int | None = None
        self._last_seq = -1
        self.next_due_ns = 0
        self.trouble = ""
        """Why there are no readings now; one line."""
        self.remarks: list[str] = []
        """What contradicts over many rounds, such as a wrong transformer ratio; each once."""

    @property
    def profile(self) -> Profile:
        """The profile, without the registers that this meter lacks."""
        return self._access.profile

    def check(self, client: ModbusClient) -> None:
        """Read and judge. Raises UserError for another model or senseless registers, ModbusError for silence."""
        self._check_identity(client)
        fault = self._persistent_fault(client)
        if fault:
            raise UserError(fault)

    def _check_identity(self, client: ModbusClient) -> None:
        """Refuse a meter that identifies itself as another model; accept one without identification registers."""
        identity, profile = self.profile.identity, self.profile
        if identity is None:
            return
        read = (identity.register.function, identity.register.address, identity.register.width)
        try:
            [data] = client.read(self.unit, [read], profile.pause_s)
        except ModbusError as error:
            if error.code is None:
                raise
            return
        code = raw_value(identity.register, data)
        if code not in identity.values:
            raise UserError(
                f"source.meters {self.settings.name!r} (unit {self.unit}): its identification register holds {code}, "
                f"profile {profile.name} expects one of {', '.join(map(str, identity.values))}; "
                "try acqd modbus probe, or use a copy of the profile without [identify]"
            )

    def _persistent_fault(self, client: ModbusClient) -> str:
        """A fault that every one of several rounds shows: a load may change between two reads of one round."""
        fault = ""
        for _ in range(_ROUNDS):
            fault = self._fault(self._access.read(client))
            if not fault:
                break
        return fault

    def read(self, client: ModbusClient, now_ns: int, utc: Callable[[], int]) -> Reading | None:
        """One round; None when it failed: then `trouble` says why, and the meter is read less often."""
        if self._first_due_ns is None:
            self._first_due_ns = now_ns
        seq = (now_ns - self._first_due_ns + self.period_ns // 2) // self.period_ns
        self.next_due_ns = self._first_due_ns + (seq + 1) * self.period_ns
        try:
            fault = "" if self._trusted else self._persistent_fault(client)
            answers = self._access.read(client) if not fault else []
        except ModbusError as error:
            fault = str(error)
        if fault:
            self._fail(fault, now_ns)
            return None
        judged = self._remarked(self._judged(client, answers, now_ns), now_ns)
        self.trouble = ""
        self._backoff.reset()
        flags = self._flags(judged.values, now_ns, missed=seq != self._last_seq + 1 and self._last_seq >= 0)
        self._last_seq = seq
        self._say_senseless(judged, answers)
        return Reading(self.settings.name, self.profile.phases, seq, utc(), judged.values, flags | judged.flags)

    def _remarked(self, judged: Judged, now_ns: int) -> Judged:
        """The round without voltages that have proven to be those between lines; says what many rounds contradict."""
        values, flags = judged.values, judged.flags
        new = [self._agreement.feed(values, now_ns), self._rated.feed(values, now_ns)]
        if self._line_voltage.feed(values):
            new.append("V x I is 1.73 times S at any load: are its voltages those between lines")
        if self._judge.too_fast:
            new.append("its energy rises faster than V x I allow: does it count Wh, or another ratio")
        for remark in new:
            if remark and remark not in self.remarks:
                self.remarks.append(remark)
                _log.warning("meter %s: %s?", self.settings.name, remark)
        if self._line_voltage.proven:
            values = {name: None if name.endswith(".Vrms") else value for name, value in values.items()}
            flags |= {INVALID}
        return Judged(values, flags)

    def _say_senseless(self, judged: Judged, answers: list[bytes]) -> None:
        """A warning where rounds that made sense no longer do: after an update of the meter, or another one."""
        lost = all(value is None for value in judged.values.values())
        self._senseless = self._senseless + 1 if lost else 0
        if self._senseless == _ROUNDS:
            advice = explain(self.profile, self._access.plan, answers, self.settings.nominal_voltage)
            _log.warning(
                "meter %s: its registers make no sense any more; %s",
                self.settings.name, advice or "was it set otherwise, updated or exchanged?",
            )  # fmt: skip

    def _judged(self, client: ModbusClient, answers: list[bytes], now_ns: int) -> Judged:
        """The round without what is no measurement; registers that contradict each other are read once more."""
        if self._judge.blank(self.profile, self._access.plan, answers):
            return Judged(dict.fromkeys(self.profile.quantities), frozenset({INVALID}))
        values = decode(self.profile, self._access.plan, answers)
        powers = [register for name, register in self.profile.quantities.items() if name.endswith(".P")]
        self._judge.one_moment = self._access.plan.together(powers)
        if self._judge.contradicts(values, now_ns):  # a load that changed between two reads of the round
            with contextlib.suppress(ModbusError):
                again = self._access.read(client)
                if not self._judge.blank(self.profile, self._access.plan, again):
                    values = decode(self.profile, self._access.plan, again)
        return self._judge.judge(values, now_ns)

    def _fail(self, trouble: str, now_ns: int) -> None:
        """Read again after a growing pause, but never sooner than the regular reading is due."""
        self.trouble = trouble
        self._backoff.due(now_ns)
        self.next_due_ns = max(self.next_due_ns, self._backoff.next_ns)

    def _fault(self, answers: list[bytes]) -> str:
        """Why the registers make no sense; empty when they do, or when nothing can be judged without voltage."""
        values = decode(self.profile, self._access.plan, answers)
        verdict = judge(self.profile, values, self.settings.nominal_voltage)
        if not verdict.faults:
            self._trusted = verdict.judged
            self._judge.expect(values)
            return ""
        advice = explain(self.profile, self._access.plan, answers, self.settings.nominal_voltage)
        return (
            f"source.meters {self.settings.name!r} (unit {self.unit}, {self.profile.name}): its registers make no "
            f"sense: {verdict.faults[0]}; {advice or 'is it this model? Try acqd modbus probe'}"
        )

    def _flags(self, values: dict[str, float | None], now_ns: int, *, missed: bool) -> frozenset[str]:
        flags = {"rms_meter"}
        if missed:
            flags.add("gap")
        seen = {name: value for name, value in values.items() if not name.endswith((".W", ".W_export"))}
        if seen != self._values:
            self._values, self._changed_ns = seen, now_ns
        voltages = [value for name, value in values.items() if name.endswith(".Vrms") and value is not None]
        if voltages and max(voltages) < _DEAD * self.settings.nominal_voltage:
            flags.add("no_mains")
        elif now_ns - self._changed_ns > _STALE_NS:
            flags.add("stale")
        return frozenset(flags)
