"""The commands that reproduce the thesis."""

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
    """Amount of data and training."""

    limited: int
    """Recordings in limited space."""
    all_space: int
    """Recordings in all space."""
    assemblies: int
    """Executions of the assembly."""
    epochs: int
    fmu_steps: int


FULL = Size(202, 135, 24, 2000, 20_000)
"""The thesis' amounts (sections 5.3, 7.5 and 9)."""
QUICK = Size(5, 5, 6, 4, 500)
"""For a test of every step. The results mean nothing."""


def training(places: Places, size: Size, seed: int) -> list[Step]:
    """Measured campaign of random motions and its dataset (thesis chapters 4 to 6)."""
    campaign = places.out / "training"
    counts = ("--limited", str(size.limited), "--all", str(size.all_space))
    return [
        Step(
            "campaign: measure random trajectories", (campaign / "report.html",),
            (("acqd", "lab", "campaign", "--out", str(campaign), *counts, "--seed", str(seed)),),
        ),
        _dataset("dataset: align clocks, split by source", campaign, places.training),
    ]  # fmt: skip


def _dataset(title: str, campaign: Path, out: Path) -> Step:
    source = ("--power", f"{campaign}/power.sqlite", "--logs", f"{campaign}/logs")
    return Step(
        title, (out / "manifest.json",),
        (("acqd", "dataset", "build", *source, "--out", str(out), "--robot", ROBOT),),
    )  # fmt: skip


def one_model(places: Places, network: str, size: Size) -> Step:
    """Train one model on all training recordings."""
    train = ("acqd", "train", str(places.training), "--network", network, "--out", str(places.bundle(network)))
    epochs = () if network == GREY_BOX else ("--epochs", str(size.epochs))
    return Step(f"train {network}", (places.bundle(network) / "bundle.json",), ((*train, *epochs),))


def table_7_1(places: Places, size: Size) -> Step:
    """Train the 14 combinations of networks and training data."""
    manual = product(("7x1dim", "14x1dim", "21x1dim"), ("all", "limited", "everything"))
    names = [*manual, *((n, "everything") for n in ARCHITECTURES if "conv" in n)]
    command = ("acqd", "train", str(places.training), "--table-7-1", "--models", str(places.models))
    return Step(
        "train the networks of Table 7.1",
        tuple(places.models / f"{network}-{kind}-s1" / "bundle.json" for network, kind in names),
        ((*command, "--epochs", str(size.epochs)),),
    )


def compared(places: Places) -> Step:
    """Compare the models (thesis chapter 8)."""
    page, figures = places.models / "report.html", places.out / "compare.json"
    command = ("acqd", "compare", str(places.training), "--models", str(places.models), "--json")
    return Step("compare models on held-out recordings", (page, figures), (command,), output=figures)


def exported(places: Places, size: Size) -> Step:
    """Export a network as FMU and test it with other importers (thesis section 9.1, appendix C.1)."""
    figures, bundle = places.out / "fmu.json", str(places.bundle(NETWORK))
    return Step(
        f"export {NETWORK} as FMU, test it with other importers",
        (places.out / "21x1dim-fmi2.fmu", places.out / "21x1dim-fmi3.fmu", figures),
        (
            *(("acqd", "export-fmu", bundle, "--fmi", f"{v}.0", "--out", f"{places.out}/21x1dim-fmi{v}.fmu")
              for v in (2, 3)),
            ("tools.studies.fmu", bundle, "--steps", str(size.fmu_steps), "--json", str(figures)),
        ),
    )  # fmt: skip


def assembly(places: Places, size: Size, seed: int) -> list[Step]:
    """Measure the assembly (thesis chapter 9) and close the loop on it."""
    campaign = places.assembly
    count = ("--profile", "use-case", "--assemblies", str(size.assemblies), "--seed", str(seed))
    loop = ("acqd", "close-loop", str(places.executions), "--model", str(places.bundle(GREY_BOX)))
    return [
        Step(
            "campaign: measure the assembly, simulate its twin", (campaign / "report.html",),
            (("acqd", "lab", "campaign", "--out", str(campaign), *count),),
        ),
        _dataset("dataset of the assembly", campaign, places.executions),
        Step("close the loop", (places.loop / "report.json",), ((*loop, "--out", str(places.loop)),)),
    ]  # fmt: skip
