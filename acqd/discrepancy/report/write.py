"""Report, pictures and the augmented bundle, all of them or none."""

from __future__ import annotations

from pathlib import Path

import orjson

from acqd.atomic import complete_folder
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.loop import Closed, provenance
from acqd.discrepancy.report.page import as_json, write_report
from acqd.errors import UserError
from acqd.models.bundle.bundle import Bundle, save_bundle
from acqd.models.bundle.reference import reference_arrays
from acqd.models.greybox.bundle_io import arrays_of
from acqd.models.greybox.model import GreyBox
from acqd.models.greybox.parameters import DENIABLE

BUNDLE = "model"


def require_writable(folder: Path) -> None:
    """A place that holds nothing, or an earlier report. Raises UserError."""
    if folder.exists() and not (folder / "report.json").exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UserError(f"{folder} exists and is no earlier report: it would be lost; choose another --out")


def write_all(order: CloseConfig, closed: Closed) -> None:
    """Fill `order.out`. Raises UserError, OperationError."""
    with complete_folder(order.out) as folder:
        write_report(folder / "report.html", order, closed)
        text = orjson.dumps(as_json(order, closed), option=orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY)
        (folder / "report.json").write_bytes(text)
        save_bundle(folder / BUNDLE, augmented_bundle(order, closed))


def augmented_bundle(order: CloseConfig, closed: Closed) -> Bundle:
    """The model with its effects; if there are any, it remembers the recordings that it was closed on."""
    subject = closed.subject
    metadata = dict(subject.bundle.metadata)
    arrays = dict(subject.bundle.arrays)
    base, improved = closed.improved.base, closed.improved.model(subject)
    if isinstance(base, GreyBox):
        arrays |= arrays_of(base)
        if (
            base is not subject.model and "parameters" in metadata
        ):  # intervals of the old fit are not those of the new one
            names = zip(base.layout.names(), base.values, strict=True)
            metadata["parameters"] = [{"name": n, "value": float(v), "unit": u, "ci95": None} for (n, u), v in names]
        restored = {group for each in closed.kept if each.restored for group in DENIABLE[each.term.id]}
        metadata["withheld"] = sorted(subject.withheld - restored)
    terms = [each.term for each in closed.kept if not each.restored]
    if terms and (not isinstance(base, GreyBox) or base is not subject.carrier):
        metadata["carrier"] = {"signals": list(subject.carrier.signals)}
        arrays |= {f"carrier.{name}": array for name, array in arrays_of(subject.carrier).items()}
    earlier = list(metadata.get("effects", []))
    metadata["effects"] = [*earlier, *(term.as_json() for term in terms)]
    known = {each["name"] for each in metadata["inputs"]}
    metadata["inputs"] = [
        *metadata["inputs"],
        *({"name": name, "unit": "V" if name == "Vrms" else "0/1"} for name in improved.signals if name not in known),
    ]
    metadata["look_ahead_rows"] = improved.radius
    if closed.kept:
        metadata["provenance"] = metadata["provenance"] | provenance(order, closed)
    metadata["loop"] = {"before": closed.before.as_json(), "after": closed.after.as_json(), "verdict": closed.verdict}
    # what was not explained must stay a change: only a model that has taken it up may forget how things were
    remembered = [*subject.held_out, *subject.fit] if closed.kept else subject.reference or subject.fit
    return Bundle(metadata, arrays, reference_arrays(remembered))
