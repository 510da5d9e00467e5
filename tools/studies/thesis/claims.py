"""Statements of the thesis, figure by figure, and the corresponding results of the reproduction.

Most figures of thesis chapter 8 have no printed numbers. There the sentences about them are compared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from acqd.models.bundle.restore import open_model
from acqd.models.compare.kernels import likeness
from acqd.models.networks.predictor import NetworkPredictor
from acqd.report.digits import percent
from tools.studies.thesis.assembly import CLOSED, GREY_BOX, NETWORK, Places

_POOR = 3.0
"""Ratio of errors above which a model counts as "performing poorly"."""


@dataclass(frozen=True, slots=True)
class Results:
    """Results of all steps."""

    places: Places
    manifest: dict[str, Any]
    compared: dict[str, Any]
    fmu: dict[str, Any]
    assembly: dict[str, Any]

    def mae(self, network: str, trained_on: str, tested_on: str = "everything") -> float:
        """MAE in W on held-out recordings."""
        return float(self._model(network, trained_on)["test"][tested_on]["mae"])

    def unstable(self, network: str) -> float:
        """Share of seconds in which the prediction oscillates."""
        return float(self._model(network, "everything")["unstable_share"])

    def _model(self, network: str, trained_on: str) -> Any:
        models = self.compared["models"]
        return next(model for model in models if (model["name"], model["trained_on"]) == (network, trained_on))


@dataclass(frozen=True, slots=True)
class Claim:
    """One statement of the thesis and its counterpart in the reproduction."""

    figure: str
    thesis: str
    here: str
    agrees: bool | None
    """None where the two cannot be compared."""


def claims(results: Results) -> list[Claim]:
    """All claims, in the order of the thesis."""
    chapters = (_data, _networks, _kernels, _use_case, _beyond)
    return [claim for chapter in chapters for claim in chapter(results)]


def _data(results: Results) -> list[Claim]:
    recordings = results.manifest["recordings"]
    splits = [sum(r["split"] == name for r in recordings) for name in ("train", "validation", "test")]
    shares = [f"{100 * count / len(recordings):.0f} %" for count in splits]
    minutes = sum(r["valid_s"] for r in recordings) / 60
    clock = results.manifest["clock"]
    lag = "unknown" if clock is None else f"{clock['offset_s']:.3f} s, {clock['drift_ppm']:+.1f} ppm"
    refused = len(results.manifest["refused"])
    return [
        Claim(
            "Table 7.2",
            "337 recordings, 332 min; 74 / 12 / 14 %",
            f"{len(recordings)} recordings, {minutes:.0f} min; {' / '.join(shares)}",
            None,
        ),
        Claim(
            "Figures 6.3, 6.4",
            "one shift by cross-correlation of mechanical and electrical power",
            f"a straight line through the shifts of all recordings: {lag}; {refused} refused",
            None,
        ),
    ]


def _networks(results: Results) -> list[Claim]:
    mae = results.mae
    limited, all_space = mae(NETWORK, "limited", "limited"), mae(NETWORK, "limited", "all")
    by_space = {kind: mae(NETWORK, kind) for kind in ("limited", "all", "everything")}
    manual = {name: mae(name, "everything") for name in ("7x1dim", "14x1dim", "21x1dim")}
    small = {name: mae(name, "everything") for name in ("2conv1x3", "3conv1x3")}
    wide = {name: mae(name, "everything") for name in ("3conv1x5", "3conv1x11", "5conv1x21")}
    every = manual | small | wide
    unstable = {name: results.unstable(name) for name in manual}
    return [
        Claim(
            "Figure 8.1",
            "trained on limited space: accurate there only",
            f"21x1dim {limited:.2f} W there, {all_space:.2f} W in all space",
            all_space > _POOR * limited,
        ),
        Claim("Figure 8.1", "trained on both: best", _listed(by_space), _best(by_space) == "everything"),
        Claim(
            "Figure 8.3",
            "error falls with every feature; 21x1dim slightly better than 14x1dim",
            _listed(manual),
            manual["7x1dim"] > manual["14x1dim"] > manual["21x1dim"],
        ),
        Claim(
            "Figure 8.5",
            "14x1dim oscillates, 21x1dim does not",
            ", ".join(f"{name} {100 * share:.2f} % of seconds" for name, share in unstable.items()),
            unstable["14x1dim"] > unstable["21x1dim"],
        ),
        Claim(
            "Figure 8.6",
            "3conv1x3 better than 2conv1x3; both worse than manual features",
            _listed(small),
            manual["21x1dim"] < small["3conv1x3"] < small["2conv1x3"],
        ),
        Claim(
            "Figure 8.11",
            "wider kernels: similar to each other, slightly worse than 21x1dim",
            _listed(wide),
            manual["21x1dim"] < min(wide.values()) and max(wide.values()) < 1.5 * min(wide.values()),
        ),
        Claim(
            "Figure 8.16",
            "21x1dim best overall (of the networks trained on both)",
            f"best {_best(every)}; {_listed(every)}",
            _best(every) == NETWORK,
        ),
    ]


def _kernels(results: Results) -> list[Claim]:
    _, model = open_model(results.places.bundle("2conv1x3"))
    assert isinstance(model, NetworkPredictor)
    kernels = [likeness(np.asarray(weight, dtype=np.float64)) for weight in model.arrays["kernel"]]
    texts = [f"w{k + 1}: {kernel.name} ({100 * kernel.first:.0f} % DoG)" for k, kernel in enumerate(kernels)]
    return [
        Claim(
            "Figure 8.9",
            "a kernel of 2conv1x3 resembles the first difference (DoG)",
            ", ".join(texts),
            max(kernel.first for kernel in kernels) > 0.8,
        )
    ]


def _use_case(results: Results) -> list[Claim]:
    network = results.assembly["models"][NETWORK]
    offset_cm = 100 * results.assembly["end_effector_m"]
    axes = results.assembly["axes_deg"]
    widest = sorted(int(k) + 1 for k in np.argsort(axes)[-2:])
    rows = [
        Claim(
            "Figure 9.3",
            "angles of axes 3 and 5 differ, the end-effector is close",
            f"axes {widest[0]} and {widest[1]} differ most ({max(axes):.0f} deg), end-effectors {offset_cm:.1f} cm",
            widest == [3, 5],
        ),
    ]
    for kind, mae, rmse in (("predicted", 4.15, 7.98), ("simulated", 6.60, 13.14)):
        errors = network[kind]
        rows.append(
            Claim(
                "Figure C.2",
                f"{kind} without the peak: MAE {mae} W, RMSE {rmse} W",
                f"{errors['mae_without_peak']:.2f} W, {errors['rmse_without_peak']:.2f} W",
                errors["mae_without_peak"] <= mae,
            )
        )
    with_peak, without_peak = network["predicted"]["rmse"], network["predicted"]["rmse_without_peak"]
    rows.append(
        Claim(
            "Figure 9.4",
            "the initial peak is not in the model",
            f"RMSE {with_peak:.1f} W with it, {without_peak:.1f} W without",
            with_peak > without_peak,
        )
    )
    return rows


def _beyond(results: Results) -> list[Claim]:
    loop, models = results.assembly["loop"], results.assembly["models"]
    effects = ", ".join(f"{e['id']} ({percent(e['confidence'])})" for e in loop["effects"]) or loop["verdict"]
    before, after = (models[name]["predicted"]["mae"] for name in (GREY_BOX, CLOSED))
    fmu = next(iter(results.fmu.values()))
    step = fmu["others"]["acqd"]["step"]
    cost = f"{step['median_us']:.2f} us per step" if isinstance(step, dict) else str(step)
    errors = [e for v in fmu["versions"].values() for e in v["importers"].values() if isinstance(e, float)]
    largest = max(errors, default=np.nan)
    return [
        Claim("beyond 9.3", "the peak remains unexplained", f"the loop identifies {effects}", None),
        Claim("beyond 9.3", "-", f"grey box, MAE with the peak: {before:.2f} W before, {after:.2f} W after", None),
        Claim(
            "Section 9.1",
            "FMU by Simulink",
            f"FMI 2.0 and 3.0, {cost}, within {largest:.0e} W of the model in {len(errors)} imports",
            None,
        ),
    ]


def _listed(mae: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.2f}" for name, value in mae.items()) + " W"


def _best(mae: dict[str, float]) -> str:
    error: Callable[[str], float] = mae.__getitem__
    return min(mae, key=error)
