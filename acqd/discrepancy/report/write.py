"""Report and augmented bundle, written completely or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import orjson

from acqd.atomic import complete_folder
from acqd.discrepancy.closed import Closed
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.repair import torque_scale
from acqd.discrepancy.repair.refit import groups_of
from acqd.discrepancy.report.page import write_report
from acqd.discrepancy.report.summary import as_json
from acqd.models.bundle.bundle import Bundle, save_bundle
from acqd.models.bundle.reference import reference_arrays
from acqd.models.greybox.bundle_io import arrays_of
from acqd.models.greybox.model import GreyBox
from acqd.report.chain import REPORT, connect

BUNDLE = "model"


def write_all(config: CloseConfig, closed: Closed) -> None:
    """Fill `config.out`. Raises UserError, OperationError."""
    with complete_folder(config.out) as folder:
        write_report(folder / REPORT, config, closed)
        text = orjson.dumps(as_json(config, closed), option=orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY)
        (folder / "report.json").write_bytes(text)
        save_bundle(folder / BUNDLE, augmented_bundle(config, closed))
    trained_on = closed.subject.bundle.metadata["provenance"].get("dataset")
    earlier = [config.dataset, *config.further, config.bundle.parent, *([Path(trained_on)] if trained_on else [])]
    connect(config.out / REPORT, [each / REPORT for each in earlier])


def augmented_bundle(config: CloseConfig, closed: Closed) -> Bundle:
    """The model with its effects.

    With new effects or a correction, the bundle remembers the recordings that it was closed on. Without, it keeps its
    reference: what was not explained must remain a change.
    """
    subject, improved = closed.subject, closed.improved
    metadata = dict(subject.bundle.metadata)
    arrays = dict(subject.bundle.arrays)
    base, model = improved.base, improved.model(subject)
    if isinstance(base, GreyBox):
        arrays |= arrays_of(base)
        _describe_refit(metadata, base, closed)
    terms = improved.terms
    if terms and (not isinstance(base, GreyBox) or base is not subject.carrier):
        metadata["carrier"] = {"signals": list(subject.carrier.signals)}
        arrays |= {f"carrier.{name}": array for name, array in arrays_of(subject.carrier).items()}
    metadata["effects"] = [*metadata.get("effects", []), *(term.as_json() for term in terms)]
    known = {each["name"] for each in metadata["inputs"]}
    new = [{"name": n, "unit": "V" if n == "Vrms" else "0/1"} for n in model.signals if n not in known]
    metadata["inputs"] = [*metadata["inputs"], *new]
    metadata["look_ahead_rows"] = model.radius
    if closed.extended:
        metadata["provenance"] = metadata["provenance"] | _provenance(config, closed)
    metadata["loop"] = {
        "before": closed.before.as_json(), "after": closed.after.as_json(), "verdict": closed.verdict
    }  # fmt: skip
    remembered = [*subject.held_out, *subject.fit] if closed.extended else subject.reference or subject.fit
    return Bundle(metadata, arrays, reference_arrays(remembered))


def _describe_refit(metadata: dict[str, Any], base: GreyBox, closed: Closed) -> None:
    """Parameters without intervals after a re-fit, because the intervals belong to the earlier fit."""
    if base is not closed.subject.model and "parameters" in metadata:
        names = zip(base.layout.names(), base.values, strict=True)
        metadata["parameters"] = [{"name": n, "value": float(v), "unit": u, "ci95": None} for (n, u), v in names]
        metadata.pop(torque_scale.KEY, None)  # a known mass calibrated the earlier fit
    restored = {group for each in closed.kept if each.restored for group in groups_of(each)}
    metadata["withheld"] = sorted(closed.subject.withheld - restored)


def _provenance(config: CloseConfig, closed: Closed) -> dict[str, Any]:
    return {
        "closed_on": str(config.dataset),
        "closed_manifest_sha256": closed.subject.data.digest,
        "closed_fit_recordings": sorted({segment.recording for segment in closed.subject.fit}),
        "closed_dataset_content": closed.subject.data.content,
        "closed_seen_content": sorted({segment.content for segment in closed.subject.fit}),
    }
