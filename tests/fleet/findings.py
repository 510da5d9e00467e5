"""Results of a fleet as workers return them, without robots."""

from acqd.fleet.config import read_fleet
from acqd.fleet.summary import judged, report_of

START_S = 1.7e9


def screened(name, p=1.0, onset_s=START_S + 7200, measured="simulated"):
    """A robot that was watched for a day."""
    screen = {
        "p": p, "chart": "level up", "height": 2.0, "onset_s": onset_s, "trained_s": START_S - 86_400,
        "first_s": START_S, "first_end_s": START_S + 60, "last_s": START_S + 86_400, "recordings": 30,
        "seconds": 3600.0,
        "rmse": 2.0 if p < 0.01 else 0.7, "reference_rmse": 0.6, "measured": measured, "content": name,
    }  # fmt: skip
    return {"name": name, "dataset": "ds", "type": "ur10e", "refused": [], "screen": screen}


def cause(name, effect, *, value=3.0, rivals=(), family=()):
    """What the loop says of a robot."""
    named = {
        "id": effect, "where": "joint 2", "confidence": 0.9, "delta_rmse": 1.0,
        "parameters": {"coefficient": {"value": value, "unit": "Nm s/rad", "ci95": [value - 0.4, value + 0.4]}},
        "rivals": [{"id": each, "name": each, "confidence": 0.1} for each in rivals],
        "family": {"members": [{"id": each, "where": "joint 2"} for each in family], "confidence": 0.9},
    }  # fmt: skip
    found = {
        "verdict": "effects_found",
        "effects": [named],
        "reason": None,
        "report": f"/f/robots/{name}/loop/report.html",
    }
    return {"name": name, "cause": found}


def hall(folder, robots=40, cold=9):
    """A fleet's report: `cold` robots with the same cause within an hour, two with their own, one broken."""
    names = [f"cell-{k:03d}" for k in range(robots)]
    (folder / "plant.toml").write_text(
        "[defaults]\nmodel = 'm'\ndataset = 'd'\n" + "".join(f"[robots.{name}]\n" for name in names)
    )
    fleet = read_fleet(folder / "plant.toml")
    results = [screened(name) for name in names]
    causes = {}
    for k in range(cold):
        results[3 * k] = screened(names[3 * k], 1e-9, START_S + 40_000 + 300 * k)
        causes[names[3 * k]] = cause(names[3 * k], "viscous_friction", value=3.0 + 0.1 * k)
    for k, effect, onset in ((1, "payload", 9_000), (4, "thermal_friction", 40_500)):
        results[k] = screened(names[k], 1e-7, START_S + onset)
        causes[names[k]] = cause(names[k], effect, rivals=["viscous_friction"])
    results[5] = {"name": names[5], "error": "/data/cell-005/power.sqlite: no such file"}
    results[7]["refused"] = ["/data/cell-007/logs/a.csv: cannot be used"]
    return fleet, report_of(fleet, judged(results, fleet.settings), causes)
