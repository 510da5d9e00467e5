"""Cells of the fleet's table, the same in the terminal and on the page."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from acqd.fleet.size import main_parameter
from acqd.report.digits import number, percent, year_text
from acqd.report.joint_names import with_joint_names

Row = dict[str, Any]
STATES = {"changed": "changed", "unchanged": "no change shown", "failed": "not judged"}


def when(unix_s: float) -> str:
    """UTC to the minute."""
    return datetime.fromtimestamp(unix_s, UTC).strftime("%Y-%m-%d %H:%M")


def since(row: Row) -> str:
    """Since when a robot has changed; a change between training and first recording is only bounded."""
    if row["since_s"] is None:
        return ""
    if row["since_before_s"] is not None:
        return f"before {when(row['since_before_s'])}"
    return when(row["since_s"])


def what(row: Row) -> str:
    """The causes, or why there is none."""
    if row["state"] == "failed":
        return str(row["error"])
    if row["state"] != "changed":
        return ""
    if row["error"]:
        return f"cause not searched: {row['error']}"
    named = ", ".join(f"{effect['id']} ({effect['where']})" for effect in row["effects"])
    named = with_joint_names(named, row.get("joint_names", ()))
    if row["verdict"] == "effects_found":
        return named
    verdict = str(row["verdict"]).replace("_", " ")
    return f"{verdict}: perhaps {named}" if named else verdict


def how_much(row: Row) -> str:
    """The main parameter of every cause with its 95 % interval."""
    texts = []
    for effect in row["effects"]:
        name = main_parameter(effect["parameters"])
        if name is not None:
            p = effect["parameters"][name]
            bounds = f" ({number(p['ci95'][0])} to {number(p['ci95'][1])})" if p["ci95"] else ""
            texts.append(f"{name} {number(p['value'])} {p['unit']}{bounds}")
    return with_joint_names("; ".join(texts), row.get("joint_names", ()))


def a_year(row: Row) -> str:
    """Energy per year of every cause with its 95 % interval, and its cost; results of earlier versions have none."""
    texts = []
    for effect in row["effects"]:
        year = effect.get("a_year")
        if year is not None:
            texts.append(year_text(year))
    return "; ".join(texts)


def how_sure(row: Row) -> str:
    """Adjusted p-value of the change, and the confidence of the first cause."""
    if row["q"] is None:
        return ""
    sure = f"q {probability(row['q'])}"
    return f"{sure}, cause {percent(row['effects'][0]['confidence'])}" if row["effects"] else sure


def probability(p: float) -> str:
    """A probability with two digits; tiny ones as a bound."""
    return "< 1e-6" if p < 1e-6 else f"{p:.2g}"


def residual(row: Row) -> str:
    """W RMS of the residual in the reference and now."""
    if row["rmse"] is None:
        return ""
    return f"{number(row['reference_rmse'], 2)} -> {number(row['rmse'], 2)}"


def shared_line(number_: int, each: dict[str, Any]) -> str:
    """A shared cause in one sentence."""
    at = f", since {when(each['since_s'][0])} to {when(each['since_s'][1])}" if each["since_s"] else ""
    sizes = each["sizes"]
    size = ""
    if sizes:
        size = (
            f"; {sizes['parameter']} {number(sizes['median'])} {sizes['unit']} in the median "
            f"({number(sizes['lowest'])} to {number(sizes['highest'])})"
        )
    return (
        f"shared cause {number_}: {each['cause']} in {len(each['robots'])} robots{at}{size}; "
        f"{each['expected']:.2g} expected by chance, p {probability(each['p'])}"
    )
