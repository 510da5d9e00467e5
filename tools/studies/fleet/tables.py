"""What the study prints."""

from __future__ import annotations

from typing import Any

from rich.table import Table

from tools.common.tables import show

_WIDTH = 130


def print_result(result: dict[str, Any]) -> None:
    """The tables of the parts that ran."""
    if "found" in result:
        show(_fleet(result), width=_WIDTH)
    if result.get("prior"):
        show(_prior(result["prior"]), width=_WIDTH)


def _fleet(result: dict[str, Any]) -> Table:
    table = Table("quantity", "value", title="acqd fleet on virtual robots (simulated)", title_justify="left")
    cpu_s, hours = result["cpu_s"], result["robots"] * result["minutes"] / 60
    made = f" (made in {result['made_s']:.0f} s)" if result["made_s"] else ""
    rows = [
        ("robots, with hidden effects", f"{result['robots']}, {result['hidden']}"),
        ("found", f"{result['found']} of {result['hidden']}; missed: {', '.join(result['missed']) or 'none'}"),
        (
            "false discoveries",
            f"{len(result['false'])} ({100 * result['false_share']:.1f} %): {', '.join(result['false'])}",
        ),
        ("cause named", f"{result['named']} of {result['found']} found"),
        ("error of the onset, median", f"{result['onset_error_min'] or 0:.1f} min"),
        ("shared cause", _shared(result["shared"])),
        ("failed", str(result["failed"])),
        ("wall time, CPU time", f"{result['wall_s']:.0f} s, {cpu_s:.0f} s with {result['jobs']} processes{made}"),
        ("CPU time per robot and hour", f"{cpu_s / hours:.1f} s"),
    ]
    for row in rows:
        table.add_row(*row)
    return table


def _prior(robots: list[dict[str, Any]]) -> Table:
    amounts = list(robots[0]["rms_W"])
    table = Table("new robot", *amounts, title="held-out RMS [W] (simulated)", title_justify="left")
    for each in robots:
        table.add_row(each["robot"], *(f"{each['rms_W'][amount]:.3f}" for amount in amounts))
    means = [sum(each["rms_W"][amount] for each in robots) / len(robots) for amount in amounts]
    table.add_row("mean", *(f"{mean:.3f}" for mean in means))
    return table


def _shared(shared: dict[str, Any] | None) -> str:
    if shared is None:
        return "none was reported"
    wrong = f", {len(shared['wrong'])} wrongly" if shared["wrong"] else ""
    return f"{shared['cause']} in {shared['of_true']} of {shared['true']} robots{wrong}, p {shared['p']:.3g}"
