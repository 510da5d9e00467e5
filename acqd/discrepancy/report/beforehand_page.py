"""The certificate as a page: what recordings of a motion can tell, and what would help most."""

from __future__ import annotations

from pathlib import Path

from acqd.discrepancy.ability.ability import table_of
from acqd.discrepancy.ability.smallest import POWER
from acqd.discrepancy.beforehand import Beforehand
from acqd.report.digits import percent
from acqd.report.page import Page


def write_page(path: Path, planned: Beforehand) -> None:
    """Write the page. Raises UserError."""
    page = Page(
        "What the recordings will tell", simulated=planned.simulated, kind="ability", subject=planned.robot,
        joints=planned.joints,
    )  # fmt: skip
    page.text(
        f"{planned.minutes:.1f} min of the motion of {planned.motion}. An effect of the size below is told from "
        f"nothing with a probability of {percent(POWER)}. A rival is told apart from the size behind its name on; "
        "without a size, no minutes of this motion suffice."
    )
    header, *rows = table_of(planned.ability)
    page.table(header, rows)
    if planned.ability.unseen:
        page.text(f"Not judged: {'; '.join(f'{name} ({why})' for name, why in planned.ability.unseen)}.")
    page.heading("What would help most")
    page.text(" ".join(planned.says))
    page.text(
        "A pair is an effect beside nothing or beside another effect, at the smallest size that shows. Sizes are "
        "medians, relative to those of the plan."
    )
    header, *rows = planned.choices_table
    page.table(header, rows)
    page.write(path)
