"""`acqd export-fmu`: export a bundle as an FMU."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import orjson
import typer

from acqd.cli.options import Json
from acqd.cli.terminal import terminal
from acqd.extras import require


def export_fmu(
    bundle: Annotated[Path, typer.Argument(metavar="BUNDLE", help="Folder that acqd train or close-loop wrote.")],
    out: Annotated[Path | None, typer.Option(help="File to write (default BUNDLE.fmu).")] = None,
    fmi: Annotated[Literal["2.0", "3.0"], typer.Option(help="Version of the FMI standard.")] = "2.0",
    platform: Annotated[
        str | None,
        typer.Option(help="Comma-separated: linux64, win64, darwin64, aarch64-linux, aarch64-darwin (default this)."),
    ] = None,
    json: Json = False,
) -> None:
    """Export a model as an FMU for co-simulation, in self-contained C with its sources.

    Example: acqd export-fmu ds.models/21x1dim-everything-s1 --out power.fmu --platform linux64,win64
    """
    require("acqd export-fmu", ("safetensors", "scipy"), "predict")
    from acqd.fmu.package import export_fmu as run
    from acqd.fmu.platforms import here

    console = terminal(stderr=True)
    target = out or bundle.with_name(f"{bundle.resolve().name}.fmu")
    platforms = [here()] if platform is None else [name.strip() for name in platform.split(",")]
    with console.status("reading the bundle") as status:
        exported = run(bundle, target, fmi, platforms, lambda activity: status.update(activity))
    result = {
        "fmu": str(exported.path),
        "fmi": exported.version,
        "bytes": exported.bytes,
        "platforms": exported.compilers,
        "inputs": [v.name for v in exported.variables if v.causality == "input"] + ["reset"],
        "outputs": [v.name for v in exported.variables if v.causality == "output"],
        "parameters": {v.name: v.start for v in exported.variables if v.causality == "parameter"},
        "notes": exported.notes,
    }
    if json:
        print(orjson.dumps(result).decode())
        return
    plain = terminal()
    size, platform_names = f"{exported.bytes / 1000:.0f} kB", ", ".join(exported.compilers)
    plain.print(f"{exported.path}: FMI {exported.version}, {size}, for {platform_names}")
    for variable in exported.variables:
        plain.print(f"  {variable.causality:9} {variable.name} [{variable.unit}] {variable.description}")
    plain.print("  input     reset [boolean] while true, the next row is the first row")
    for note in exported.notes:
        plain.print(note)
