"""Which commands make up the thesis."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from pathlib import Path

from acqd.models.networks.architecture import ARCHITECTURES
from tools.studies.thesis.assembly import GREY_BOX, NETWORK, Places
from tools.studies.thesis.steps import Step

ROBOT = "iiwa7_r800"


@dataclass(frozen=True, slots=True)
class Size:
    """How much of everything."""

    limited: int
    all_space: int
    assemblies: int
    epochs: int
    fmu_steps: int


FULL = Size(202, 135, 24, 2000, 20_000)
"""Thesis sections 5.3, 7.5 and 9."""
QUICK = Size(8, 8, 6, 4, 2000)
"""Shows that every step works; its figures mean nothing."""


def training(places: Places, size: Size, seed: int) -> list[Step]:
    """Excite, measure, merge (chapters 4 to 6)."""
    campaign = places.out / "training"
    counts = ("--limited", str(size.limited), "--all", str(size.all_space))
    return [
        Step(
            "campaign: random trajectories, measured", (campaign / "report.html",),
            (("acqd", "lab", "campaign", "--out", str(campaign), *counts, "--seed", str(seed)),),
        ),
        _dataset("dataset: clocks aligned, split by source", campaign, places.training),
    ]  # fmt: skip


def _dataset(title: str, campaign: Path, out: Path) -> Step:
    source = ("--power", f"{campaign}/power.sqlite", "--logs", f"{campaign}/logs")
    return Step(
        title, (out / "manifest.json",),
        (("acqd", "dataset", "build", *source, "--out", str(out), "--robot", ROBOT),),
    )  # fmt: skip


def one_model(places: Places, network: str, size: Size) -> Step:
    """Of everything there is."""
    train = ("acqd", "train", str(places.training), "--network", network, "--out", str(places.bundle(network)))
    epochs = () if network == GREY_BOX else ("--epochs", str(size.epochs))
    return Step(f"train {network}", (places.bundle(network) / "bundle.json",), ((*train, *epochs),))


def table_7_1(places: Places, size: Size) -> Step:
    """The 14 combinations of networks and training data."""
    manual = product(("7x1dim", "14x1dim", "21x1dim"), ("all", "limited", "everything"))
    names = [*manual, *((n, "everything") for n in ARCHITECTURES if "conv" in n)]
    command = ("acqd", "train", str(places.training), "--table-7-1", "--models", str(places.models))
    return Step(
        "train the networks of Table 7.1",
        tuple(places.models / f"{network}-{kind}-s1" / "bundle.json" for network, kind in names),
        ((*command, "--epochs", str(size.epochs)),),
    )


def compared(places: Places) -> Step:
    """Chapter 8."""
    page, figures = places.models / "report.html", places.out / "compare.json"
    command = ("acqd", "compare", str(places.training), "--models", str(places.models), "--json")
    return Step("compare on recordings that none has seen", (page, figures), (command,), told=figures)


def exported(places: Places, size: Size) -> Step:
    """Section 9.1 and appendix C.1: the FMU, judged by others."""
    figures, bundle = places.out / "fmu.json", str(places.bundle(NETWORK))
    return Step(
        f"FMU of {NETWORK}, judged by others",
        (places.out / "21x1dim-fmi2.fmu", places.out / "21x1dim-fmi3.fmu", figures),
        (
            *(("acqd", "export-fmu", bundle, "--fmi", f"{v}.0", "--out", f"{places.out}/21x1dim-fmi{v}.fmu")
              for v in (2, 3)),
            ("tools.studies.fmu", bundle, "--steps", str(size.fmu_steps), "--json", str(figures)),
        ),
    )  # fmt: skip


def assembly(places: Places, size: Size, seed: int) -> list[Step]:
    """Chapter 9 and beyond: the assembly measured, and the loop closed on it."""
    campaign = places.assembly
    count = ("--profile", "use-case", "--assemblies", str(size.assemblies), "--seed", str(seed))
    loop = ("acqd", "close-loop", str(places.executions), "--model", str(places.bundle(GREY_BOX)))
    return [
        Step(
            "assembly measured, and its twin", (campaign / "report.html",),
            (("acqd", "lab", "campaign", "--out", str(campaign), *count),),
        ),
        _dataset("assembly aligned", campaign, places.executions),
        Step("loop closed", (places.loop / "report.json",), ((*loop, "--out", str(places.loop)),)),
    ]  # fmt: skip
