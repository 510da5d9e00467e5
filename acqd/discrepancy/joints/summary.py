"""What the logged torques show, joint by joint, for the report."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.joints.witness import Witness
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.discrepancy.thresholds.chance import by_chance
from acqd.models.effects import library


@dataclass(frozen=True, slots=True)
class JointLevel:
    """Logged torque minus that of the reference's base model, with the zeros and friction of each log."""

    measured_at: str
    """link: torque sensors; motor: currents times the nominal torque constant."""
    rms_reference: Floats
    """[axes] Nm RMS in the reference."""
    rms: Floats
    """[axes] Nm RMS in the recordings in question."""
    logged: list[Floats]
    """Per joint: [rows] Nm of the recordings in question, while the joint moves."""
    modelled: list[Floats]
    """Per joint: [rows] Nm, the base model's torque in the same rows."""
    explains: str
    """Id of the mechanical effect with the largest evidence; "" if none explains more than chance."""
    evidence: float
    """Twice its log-likelihood ratio against no change, minus k log n."""

    @property
    def changed(self) -> list[int]:
        """Joints (from 1) whose difference has grown clearly against the reference."""
        usual = np.exp(THRESHOLDS.interval_width * THRESHOLDS.usual_growth) * self.rms_reference
        spans = np.array([np.ptp(each) if len(each) else 0.0 for each in self.logged])
        matters = self.rms > THRESHOLDS.least_share_of_range * spans
        return [int(k) + 1 for k in np.flatnonzero(matters & (self.rms > usual) & (self.rms_reference > 0))]

    def as_text(self) -> str:
        """A sentence for the report."""
        source = "logged torques" if self.measured_at == "link" else "torques from the logged currents"
        joints = ", ".join(
            f"joint {k} by {self.rms[k - 1]:.2f} Nm RMS ({self.rms_reference[k - 1]:.2f} Nm in the reference)"
            for k in self.changed
        )
        if self.explains:
            where = f": {joints}" if joints else ""
            return (
                f"{source} show a mechanical change{where}; of the effects of the library, {self.explains} explains it "
                f"best{self._left_out()}"
            )
        left_out = self._left_out()
        if joints:
            return f"{source} have changed, and no mechanical effect of the library explains it: {joints}{left_out}"
        worst = int(np.argmax(self.rms))
        return (
            f"{source} follow the reference's model as they did (at most {self.rms[worst]:.2f} Nm RMS at joint "
            f"{worst + 1}, {self.rms_reference[worst]:.2f} Nm in the reference): no mechanical change shows{left_out}"
        )

    def _left_out(self) -> str:
        """Joints without enough moving rows in the reference, in words."""
        joints = ", ".join(f"joint {k + 1}" for k in np.flatnonzero(self.rms_reference == 0))
        return f"; not judged, because the reference hardly moves them: {joints}" if joints else ""

    def as_json(self) -> list[dict[str, float]]:
        """One entry per joint."""
        pairs = zip(self.rms_reference.tolist(), self.rms.tolist(), strict=True)
        return [{"joint": k + 1, "rms_reference_Nm": before, "rms_Nm": now} for k, (before, now) in enumerate(pairs)]


def joint_level(witness: Witness | None, chosen: frozenset[str]) -> JointLevel | None:
    """None without torques on both sides; `chosen`: ids of effects that compete."""
    if witness is None:
        return None
    observed = witness.observed
    axes = observed.layout.axes
    logged: list[list[Floats]] = [[] for _ in range(axes)]
    modelled: list[list[Floats]] = [[] for _ in range(axes)]
    reference: list[list[Floats]] = [[] for _ in range(axes)]
    own = {session.name: witness.common_and_own(session) for session in witness.sessions}
    for each in observed.rows:
        predicted = each.base @ own[each.session]
        if each.in_question:
            logged[each.joint].append(each.torque)
            modelled[each.joint].append(predicted)
        else:
            reference[each.joint].append(each.torque - predicted)
    now = [np.concatenate(parts) if parts else np.zeros(0) for parts in logged]
    model = [np.concatenate(parts) if parts else np.zeros(0) for parts in modelled]
    before = [np.concatenate(parts) if parts else np.zeros(0) for parts in reference]
    explains, evidence = _best(witness, chosen, sum(len(values) for values in now))
    return JointLevel(
        observed.layout.side, _rms(before), _rms([a - b for a, b in zip(now, model, strict=True)]), now, model,
        explains, evidence,
    )  # fmt: skip


def _rms(values: list[Floats]) -> Floats:
    return np.array([float(np.sqrt(np.mean(np.square(each)))) if len(each) else 0.0 for each in values])


def _best(witness: Witness, chosen: frozenset[str], rows: int) -> tuple[str, float]:
    """The effect with the largest evidence above the limit, and that evidence."""
    scene = next(iter(witness.observed.scenes.values()))
    weights = {session.name: 1.0 for session in witness.sessions if session.in_question}
    seen = [effect_id for effect_id in library() if effect_id in chosen and witness.sees(effect_id)]
    best, most = "", by_chance(max(len(seen), 1))
    for effect_id in seen:
        for variant in library()[effect_id].variants(scene):
            information = witness.information(effect_id, variant, weights, scanned=True)
            evidence = information.evidence - variant.size * float(np.log(max(rows, 2)))
            if evidence > most:
                best, most = effect_id, evidence
    return best, most if best else 0.0
