"""The watch on a growing dataset: an alarm when the residual changes, then a proposal from the recordings since."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

import orjson

from acqd.atomic import write_complete
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.loop import close_loop
from acqd.discrepancy.recordings import trained_recordings
from acqd.discrepancy.report.summary import as_json
from acqd.discrepancy.report.write import write_all
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.errors import InputError, UserError
from acqd.models.bundle.bundle import Bundle, fingerprint
from acqd.models.bundle.restore import open_model
from acqd.models.metrics import predictions
from acqd.models.segments import Dataset, Segment, load_dataset
from acqd.monitor.baseline import baseline_of
from acqd.monitor.cusum import Alarm, Monitor
from acqd.monitor.thresholds import MONITOR
from acqd.residual.residuals import residuals, rms

STATE = "watch.json"
SHORTEST_S = MONITOR.cusum_block_s / 2
"""Shortest segment that has a block of the charts."""
_BY = "content"  # how a state knows recordings


@dataclass(frozen=True, slots=True)
class Event:
    """A message of the watch."""

    kind: str
    """resumed, recording, alarm, proposal, or trouble with the dataset."""
    details: dict[str, Any]


class Watch:
    """One model on one growing dataset. Nothing is ever applied: proposals are written to `config.out`.

    The recordings seen, the charts and the alarm survive a restart (`watch.json`).
    """

    def __init__(self, config: CloseConfig, between_s: float) -> None:
        """`between_s`: recorded seconds per false alarm. Raises UserError, InputError."""
        self._config = config
        self._bundle: Bundle
        self._bundle, self._model = open_model(config.bundle)
        self._monitor = Monitor(baseline_of(config.bundle, self._model, between_s))
        self._seen: set[str] = set()
        """Contents of the recordings that were judged, or that the model was fitted on."""
        self._tried = 0  # recordings since the onset at the last attempt
        self._settled = False
        self._digest = ""
        self._trouble = ""
        self._state = config.out / STATE
        self.resumed: Event | None = None
        """State of an earlier watch that continues."""
        self._restore()

    def look(self, progress: Callable[[str, float], None]) -> Iterator[Event]:
        """Judge new recordings of the dataset; nothing while there is no dataset. Raises UserError, InputError."""
        try:
            digest = hashlib.sha256((self._config.dataset / "manifest.json").read_bytes()).hexdigest()
        except FileNotFoundError:
            return
        if digest == self._digest:
            return
        try:
            data = load_dataset(self._config.dataset)
        except (UserError, InputError) as error:  # the dataset may be under construction; the next look decides
            if str(error) != self._trouble:
                yield Event("trouble", {"reason": str(error)})
            self._trouble = str(error)
            return
        self._trouble = ""
        if data.axes != self._model.axes:
            raise UserError(f"{self._config.dataset} has {data.axes} axes, the model {self._model.axes}")
        # by content: recorders use the same names again
        self._seen |= trained_recordings(self._bundle.metadata["provenance"], data)
        new = [segment for segment in data.segments if segment.content not in self._seen]
        for recording, segments in in_time(new):
            yield from self._judge(recording, segments, data.step_s)
        self._digest = digest
        self._save()
        yield from self._propose(data, progress)

    def _judge(self, recording: str, segments: list[Segment], step_s: float) -> Iterator[Event]:
        alarm = None
        predicted = predictions(self._model, segments)
        errors = residuals(predicted, segments)
        for segment, residual, prediction in zip(segments, errors, predicted, strict=True):
            alarm = self._monitor.update(residual, prediction, segment.start_s, step_s, segment) or alarm
        self._seen |= {segment.content for segment in segments}
        judged = any(len(segment.P) * step_s >= SHORTEST_S for segment in segments)
        yield Event("recording", {"recording": recording, "rmse": rms(errors), "judged": judged})
        if alarm is not None:
            yield Event("alarm", alarm.as_json() | {"recording": recording})

    def _propose(self, data: Dataset, progress: Callable[[str, float], None]) -> Iterator[Event]:
        """Close the loop on the recordings since the onset: as soon as there are enough, and after every doubling."""
        alarm = self._monitor.alarm
        if alarm is None or self._settled:
            return
        affected = [s for s in data.segments if s.start_s + len(s.P) * data.step_s > alarm.onset_s]
        count = len({segment.recording for segment in affected})
        seconds = sum(len(segment.P) for segment in affected) * data.step_s
        if count < max(THRESHOLDS.fewest_recordings, 2 * self._tried) or seconds < THRESHOLDS.shortest_total_s:
            return
        self._tried = count
        yield self._proposal(alarm, count, progress)

    def _proposal(self, alarm: Alarm, count: int, progress: Callable[[str, float], None]) -> Event:
        name = datetime.fromtimestamp(alarm.onset_s, UTC).strftime("proposal-%Y%m%dT%H%M%SZ")
        config = replace(self._config, out=self._config.out / f"{name}-{count}", since_s=alarm.onset_s)
        try:
            closed = close_loop(config, progress)
        except (UserError, InputError) as error:
            self._save()
            return Event("proposal", {"verdict": "not_identifiable", "reason": str(error), "recordings": count})
        write_all(config, closed)
        report = as_json(config, closed)
        self._settled = closed.verdict == "effects_found"
        self._save()
        keys = ("verdict", "effects", "correction", "before", "after", "next", "joint_names")
        kept = {key: report[key] for key in keys}
        return Event("proposal", kept | {"out": str(config.out), "recordings": count})

    def _restore(self) -> None:
        """Continue an earlier watch with the same model."""
        if not self._state.exists():
            return
        try:
            state = orjson.loads(self._state.read_bytes())
            if state["model"] != self._model_name() or state.get("seen_by") != _BY:
                return  # another model judges all recordings again, as does a watch that knew them by name only
            self._monitor.restore(state["monitor"])
            self._seen |= set(state["seen"])
            self._tried, self._settled = int(state["tried"]), bool(state["settled"])
        except (OSError, orjson.JSONDecodeError, KeyError, ValueError, TypeError) as error:
            raise InputError(self._state, f"is not the state of a watch ({error}); delete it to start again") from None
        alarm = self._monitor.alarm
        details = {"recordings": len(state["seen"]), "proposed": self._settled}
        self.resumed = Event("resumed", details | {"alarm": None if alarm is None else alarm.as_json()})

    def _save(self) -> None:
        state = {
            "model": self._model_name(), "monitor": self._monitor.as_json(), "seen_by": _BY, "seen": sorted(self._seen),
            "tried": self._tried, "settled": self._settled,
        }  # fmt: skip
        write_complete(self._state, orjson.dumps(state, option=orjson.OPT_INDENT_2))

    def _model_name(self) -> str:
        return fingerprint(self._config.bundle)


def in_time(segments: list[Segment]) -> list[tuple[str, list[Segment]]]:
    """Segments by recording, the earliest recording first."""
    recordings: dict[str, list[Segment]] = {}
    for segment in sorted(segments, key=lambda each: each.start_s):
        recordings.setdefault(segment.recording, []).append(segment)
    return list(recordings.items())
