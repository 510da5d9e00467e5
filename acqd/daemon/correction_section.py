"""`[source.correction]` of acqd.toml: errors of the transformers in front of a box."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from acqd.errors import SettingError
from acqd.metering import StreamFormat
from acqd.metering.correction import ChannelErrors, Correction, Reordered
from acqd.metering.quality.response import Response, Responses
from acqd.metering.wiring_finding import WiringFinding
from acqd.section import Section


def _not_zero(gain: float) -> float:
    if not gain:
        raise ValueError("a gain of 0 leaves nothing; expected a factor, negative for a reversed transformer")
    return gain


def _rising(points: list[list[float]]) -> list[list[float]]:
    if not points:
        return points
    if len(points) == 1 or any(len(point) != 3 for point in points):
        raise ValueError("expected two or more points [Hz, ratio, degrees]")
    hertz = [point[0] for point in points]
    if hertz[0] < 0 or any(after <= before for before, after in pairwise(hertz)):
        raise ValueError("expected frequencies that rise from point to point, 0 Hz or more")
    if not all(_LEAST_RATIO <= point[1] <= 1 / _LEAST_RATIO for point in points):
        raise ValueError("expected ratios of measured to true value from 0.01 to 100")
    return points


_LEAST_RATIO = 0.01
_EXACT = 0.001
"""How much a response may differ from 1 at the nominal frequency."""
_Points = Annotated[list[list[float]], AfterValidator(_rising), Field(max_length=100)]
_Delay = Annotated[float, Field(ge=-1000, le=1000)]
_Gain = Annotated[float, AfterValidator(_not_zero), Field(gt=-1e6, lt=1e6)]
_Gains = Annotated[list[_Gain], Field(min_length=1, max_length=3)]
_Offsets = Annotated[list[float], Field(min_length=1, max_length=3)]
_Delays = Annotated[list[_Delay], Field(min_length=1, max_length=3)]


class CorrectionSection(Section):
    """One value per phase, or one for all phases."""

    u_gain: _Gains = Field(default=[1.0])
    i_gain: _Gains = Field(default=[1.0])
    u_offset: _Offsets = Field(default=[0.0])
    i_offset: _Offsets = Field(default=[0.0])
    u_delay_us: _Delays = Field(default=[0.0])
    i_delay_us: _Delays = Field(default=[0.0])
    u_response: _Points = Field(default=[])
    i_response: _Points = Field(default=[])
    """Points [Hz, ratio, degrees] of the transformers of all phases: measured over true value. Of spectra alone."""
    i_order: Annotated[list[int], Field(max_length=3)] = Field(default=[])
    """Numbers of the channels whose currents are those of L1, L2, L3; before the other keys. Empty: as they are."""

    def reordered(self, form: StreamFormat) -> Reordered | None:
        """The exchange of currents; None where they stay. Raises SettingError."""
        if self.i_order in ([], list(range(1, form.phases + 1))):
            return None
        try:
            return Reordered(form, self.i_order)
        except ValueError as error:
            raise SettingError(f"source.correction.{error}") from None

    def of(self, form: StreamFormat) -> Correction | None:
        """The correction of a stream; None where there is nothing to correct. Raises SettingError."""
        self.responses(form)
        if self == CorrectionSection(i_order=self.i_order, u_response=self.u_response, i_response=self.i_response):
            return None
        gain, offset = self._pairs("gain", form.phases), self._pairs("offset", form.phases)
        delay_s = [delay * 1e-6 for delay in self._pairs("delay_us", form.phases)]
        return Correction(form, ChannelErrors(gain, offset, delay_s))

    def responses(self, form: StreamFormat) -> Responses:
        """Of voltages and currents. Raises SettingError for one that is not 1 at the nominal frequency."""
        return self._response("u", form.f_nominal), self._response("i", form.f_nominal)

    def _response(self, quantity: str, f_nominal: float) -> Response | None:
        points: list[list[float]] = getattr(self, f"{quantity}_response")
        if not points:
            return None
        response = Response(*map(tuple, zip(*points, strict=True)))
        if abs(response.at(f_nominal) - 1) > _EXACT:
            raise SettingError(
                f"source.correction.{quantity}_response: expected 1 and 0 degrees at {f_nominal:g} Hz; what the "
                f"transformers do there belongs into {quantity}_gain and {quantity}_delay_us"
            )
        return response

    def after(self, finding: WiringFinding) -> str:
        """What to paste instead of this section, whose corrected currents the finding is about; empty for none."""
        if not finding.correction:
            return ""
        phases = len(finding.order)
        places = [k - 1 for k in finding.order]
        order = self.i_order or list(range(1, phases + 1))
        changed: dict[str, list[Any]] = {"i_order": [order[k] for k in places]}
        for name in ("i_gain", "i_offset", "i_delay_us"):
            values = getattr(self, name)
            changed[name] = [values[k % len(values)] for k in places]
        changed["i_gain"] = [round(gain * more, 9) for gain, more in zip(changed["i_gain"], finding.gains, strict=True)]
        if changed["i_order"] == list(range(1, phases + 1)):
            changed["i_order"] = []
        whole = self.model_dump() | changed
        idle = {"gain": [1.0], "offset": [0.0], "us": [0.0], "order": [], "response": []}
        keys = [
            f"{name} = {values}"
            for name, values in whole.items()
            if any(value not in idle[name.rpartition("_")[2]] for value in values)
        ]
        return f"[source] correction = {{ {', '.join(keys)} }}" if keys else "[source] correction = {}"

    def _pairs(self, name: str, phases: int) -> list[float]:
        """Values in the order U1, I1, U2, I2 ..."""
        pairs: list[float] = []
        for phase in range(phases):
            for quantity in "ui":
                key = f"{quantity}_{name}"
                values = getattr(self, key)
                if len(values) not in (1, phases):
                    raise SettingError(
                        f"source.correction.{key}: {len(values)} values, but the source has {phases} phases; "
                        f"give one for each phase, or one for all"
                    )
                pairs.append(values[phase % len(values)])
        return pairs
