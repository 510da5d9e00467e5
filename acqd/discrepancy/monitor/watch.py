"""A dataset that grows, watched: alarm when the residual changes, tracing on what came since, a proposal."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import orjson

from acqd.atomic import write_complete
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.loop import close_loop
from acqd.discrepancy.monitor.cusum import Baseline, Monitor
from acqd.discrepancy.recordings import FEWEST_RECORDINGS, LEAST_S, seen_by
from acqd.discrepancy.repair.terms import errors_of, residuals, rms
from acqd.discrepancy.report.page import as_json
from acqd.discrepancy.report.write import write_all
from acqd.errors import InputError, UserError
from acqd.models.bundle.bundle import Bundle, fingerprint
from acqd.models.bundle.reference import load_reference
from acqd.models.bundle.restore import open_model
from acqd.models.metrics import predictions
from acqd.models.predictor import Predictor
from acqd.models.segments import Segment, load_dataset

STATE = "watch.json"


@dataclass(frozen=True, slots=True)
class Event:
    """Something that the watch tells."""

    kind: str
    """resumed, recording, alarm, proposal, or trouble with the dataset."""
    details: dict[str, Any]


def baseline_of(bundle: Path, model: Predictor, between_s: float) -> Baseline:
    """From the recordings that the bundle remembers; raises UserError when they are too few.

    A model leaves less on recordings that it was fitted on: those count as if it left as much there as on others.
    """
    remembered = load_reference(bundle)
    errors = errors_of(model, remembered) if remembered else []
    fitted = [segment.split == "train" for segment in remembered]
    unseen = [off for off, own in zip(errors, fitted, strict=True) if not own]
    seen = [off for off, own in zip(errors, fitted, strict=True) if own]
    more = max(1.0, rms(unseen) / max(rms(seen), 1e-9)) if seen and unseen else 1.0
    errors = [off * (more if own else 1.0) for off, own in zip(errors, fitted, strict=True)]
    if errors:
        starts = [segment.start_s for segment in remembered]
        found = Baseline.of(errors, predictions(model, remembered), starts, model.step_s, between_s)
        if found is not None:
            return found
    raise UserError(
        f"{bundle} remembers too few recordings to tell a change from chance (two minutes are the least); "
        "train it on a dataset with more, or close the loop on it once"
    )


class Watch:
    """One model beside one growing dataset. Nothing is ever applied: proposals lie in `order.out`.

    What was seen, the sums and the alarm outlive the process (`watch.json`).
    """

    def __init__(self, order: CloseConfig, between_s: float) -> None:
        """Raises UserError, InputError."""
        self._order = order
        self._bundle: Bundle
        self._bundle, self._model = open_model(order.bundle)
        self._monitor = Monitor(baseline_of(order.bundle, self._model, between_s))
        fitted, _ = seen_by(self._bundle.metadata["provenance"])
        self._seen: set[str] = set(fitted)
        self._tried = 0  # affected recordings when tracing was tried last
        self._settled = False
        self._digest = ""
        self._trouble = ""
        self._state = order.out / STATE
        self.resumed: Event | None = None
        """Where an earlier watch stopped."""
        self._go_on()

    def look(self, progress: Callable[[str, float], None]) -> Iterator[Event]:
        """Take what is new in the dataset; nothing while it is not there. Raises UserError, InputError."""
        try:
            digest = hashlib.sha256((self._order.dataset / "manifest.json").read_bytes()).hexdigest()
        except FileNotFoundError:
            return
        if digest == self._digest:
            return
        try:
            data = load_dataset(self._order.dataset)
        except (UserError, InputError) as error:  # it may be just being built anew: the next look tells
            if str(error) != self._trouble:
                yield Event("trouble", {"reason": str(error)})
            self._trouble = str(error)
            return
        self._trouble = ""
        if data.axes != self._model.axes:
            raise UserError(f"{self._order.dataset} has {data.axes} axes, the model {self._model.axes}")
        new = [segment for segment in data.segments if segment.recording not in self._seen]
        for recording, segments in in_time(new):
            yield from self._take(recording, segments, data.step_s)
        self._digest = digest
        self._remember()
        yield from self._propose(data.segments, data.step_s, progress)

    def _take(self, recording: str, segments: list[Segment], step_s: float) -> Iterator[Event]:
        alarm = None
        predicted = predictions(self._model, segments)
        errors = residuals(predicted, segments)
        for segment, off, guess in zip(segments, errors, predicted, strict=True):
            alarm = self._monitor.update(off, guess, segment.start_s, step_s) or alarm
        self._seen.add(recording)
        yield Event("recording", {"recording": recording, "rmse": rms(errors)})
        if alarm is not None:
            yield Event("alarm", alarm.as_json() | {"recording": recording})

    def _propose(
        self, segments: list[Segment], step_s: float, progress: Callable[[str, float], None]
    ) -> Iterator[Event]:
        """Trace on what came since the onset: with the first few recordings, and whenever there are twice as many."""
        alarm = self._monitor.alarm
        if alarm is None or self._settled:
            return
        affected = [s for s in segments if s.start_s + len(s.P) * step_s > alarm.onset_s]
        count = len({segment.recording for segment in affected})
        seconds = sum(len(segment.P) for segment in affected) * step_s
        if count < max(FEWEST_RECORDINGS, 2 * self._tried) or seconds < LEAST_S:
            return
        name = datetime.fromtimestamp(alarm.onset_s, UTC).strftime("proposal-%Y%m%dT%H%M%SZ")
        order = replace(self._order, out=self._order.out / f"{name}-{count}", since_s=alarm.onset_s)
        self._tried = count
        try:
            closed = close_loop(order, progress)
        except (UserError, InputError) as error:
            self._remember()
            yield Event("proposal", {"verdict": "not_identifiable", "reason": str(error), "recordings": count})
            return
        write_all(order, closed)
        report = as_json(order, closed)
        self._settled = closed.verdict == "effects_found"
        self._remember()
        kept = ("verdict", "effects", "before", "after", "next")
        yield Event("proposal", {key: report[key] for key in kept} | {"out": str(order.out), "recordings": count})

    def _go_on(self) -> None:
        """Where an earlier watch stopped, if it watched with the same model."""
        if not self._state.exists():
            return
        try:
            state = orjson.loads(self._state.read_bytes())
            if state["model"] != self._model_name():
                return  # another model: everything is looked at anew
            self._monitor.restore(state["monitor"])
            self._seen |= set(state["seen"])
            self._tried, self._settled = int(state["tried"]), bool(state["settled"])
            alarm = self._monitor.alarm
            self.resumed = Event(
                "resumed",
                {"recordings": len(state["seen"]), "proposed": self._settled}
                | {"alarm": None if alarm is None else alarm.as_json()},
            )
        except (OSError, orjson.JSONDecodeError, KeyError, ValueError, TypeError) as error:
            raise InputError(self._state, f"is no state of a watch ({error}); delete it to begin anew") from None

    def _remember(self) -> None:
        state = {
            "model": self._model_name(), "monitor": self._monitor.as_json(), "seen": sorted(self._seen),
            "tried": self._tried, "settled": self._settled,
        }  # fmt: skip
        write_complete(self._state, orjson.dumps(state, option=orjson.OPT_INDENT_2))

    def _model_name(self) -> str:
        return fingerprint(self._order.bundle)


def in_time(segments: list[Segment]) -> list[tuple[str, list[Segment]]]:
    """By recording, the earliest first."""
    found: dict[str, list[Segment]] = {}
    for segment in sorted(segments, key=lambda each: each.start_s):
        found.setdefault(segment.recording, []).append(segment)
    return list(found.items())
