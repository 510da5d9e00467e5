"""Export of a bundle as an .fmu file."""

from __future__ import annotations

import contextlib
import tempfile
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import orjson

from acqd.atomic import require_earlier
from acqd.errors import UserError
from acqd.fmu.constants import sources, token_of
from acqd.fmu.description import IDENTIFIER, Described, Version, build_description, description
from acqd.fmu.platforms import PLATFORMS, Platform, build
from acqd.fmu.variables import Variable, left_out, variables
from acqd.models.bundle.bundle import Bundle
from acqd.models.bundle.restore import open_model
from acqd.models.predictor import Predictor

_C = Path(__file__).parent / "c"
_COMMON = ("model.c", "network.c", "greybox.c", "substeps.c", "substeps_avx2.c", "instance.c")
_HEADERS = (
    "acqd_model.h",
    "model_parts.h",
    "vectors.h",
    "lanes.h",
    "rigid_body.h",
    "switches.h",
    "substep_lanes.h",
    "instance.h",
)
_OWN: dict[str, tuple[str, str]] = {"2.0": ("fmi2.c", "fmi2_abi.h"), "3.0": ("fmi3.c", "fmi3_abi.h")}


@dataclass(frozen=True, slots=True)
class Exported:
    """An exported FMU."""

    path: Path
    version: Version
    bytes: int
    variables: list[Variable]
    compilers: dict[str, str]
    """Compiler of the binary, by platform."""
    notes: list[str]


def export_fmu(
    bundle: Path, out: Path, fmi: Version, platforms: Sequence[str], progress: Callable[[str], None]
) -> Exported:
    """Write the file `out` completely or not at all. Raises UserError, InputError, OperationError."""
    for name in platforms:
        if name not in PLATFORMS:
            raise UserError(f"no platform {name!r}; the platforms are {', '.join(PLATFORMS)}")
    if out.is_dir():
        raise UserError(f"{out} is a folder; name the file with --out")
    require_earlier(out, IDENTIFIER.encode(), "FMU of acqd")
    opened, model = open_model(bundle)
    _require_revolute(bundle, opened)
    try:
        return _export(opened, model, out, fmi, platforms, progress)
    except OSError as error:
        raise UserError(
            f"{tempfile.gettempdir()}: {error.strerror}; make room there, or name another folder with TMPDIR"
        ) from None


def _require_revolute(path: Path, bundle: Bundle) -> None:
    """Raises UserError for a prismatic joint: the C sources turn every joint."""
    sliding = [each["name"] for each in bundle.metadata.get("inputs", []) if each["unit"] == "m"]
    if sliding:
        raise UserError(
            f"{path}: {', '.join(sliding)} is prismatic, and an FMU knows revolute joints only; use acqd predict"
        )


def _export(
    opened: Bundle,
    model: Predictor,
    out: Path,
    fmi: Version,
    platforms: Sequence[str],
    progress: Callable[[str], None],
) -> Exported:
    files = sources(model)
    shown = variables(model)
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        names = _lay_out(root, files, fmi)
        compilers = {}
        for name in platforms:
            progress(f"compiling for {name}")
            compilers[name] = _binary(root, PLATFORMS[name], names, fmi)
        made = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        metadata = opened.metadata
        text = f"mains power of {metadata['robot']} from its joint angles, by the model {metadata['name']}"
        what = Described(
            str(metadata["name"]), text, token_of(files), f"acqd {version('acqd')}", made, model.step_s, names
        )
        (root / "modelDescription.xml").write_bytes(description(fmi, what, shown))
        if fmi == "3.0":
            (root / "sources" / "buildDescription.xml").write_bytes(build_description(names))
        (root / "resources").mkdir()
        provenance = orjson.dumps(_provenance(opened, model), option=orjson.OPT_INDENT_2)
        (root / "resources" / "bundle.json").write_bytes(provenance)
        progress("packing")
        _pack(root, out)
    return Exported(out, fmi, out.stat().st_size, shown, compilers, left_out(model))


def _lay_out(root: Path, files: dict[str, str], fmi: Version) -> list[str]:
    """Write the sources to be packed. Returns the names of those to be compiled."""
    folder = root / "sources"
    folder.mkdir()
    own, abi = _OWN[fmi]
    for name in (*_COMMON, *_HEADERS, own, abi):
        (folder / name).write_bytes((_C / name).read_bytes())
    for name, text in files.items():
        (folder / name).write_text(text, encoding="ascii")
    return [*_COMMON, own]


def _binary(root: Path, target: Platform, names: Sequence[str], fmi: Version) -> str:
    folder = root / "binaries" / target.folders[fmi == "3.0"]
    folder.mkdir(parents=True)
    paths = [root / "sources" / name for name in names]
    compiler = build(target, paths, root / "sources", folder / f"{IDENTIFIER}{target.suffix}")
    for byproduct in (*folder.glob("*.lib"), *folder.glob("*.pdb")):
        byproduct.unlink()
    return compiler


def _provenance(opened: Bundle, model: Predictor) -> dict[str, Any]:
    """Origin of the model, so that the FMU can be traced back to its bundle."""
    kept = ("name", "kind", "robot", "step_s", "envelope", "metrics", "provenance", "loop")
    return {name: opened.metadata[name] for name in kept if name in opened.metadata} | {
        "look_ahead_rows": model.radius,
        "effects": [
            {key: each[key] for key in ("id", "where", "parameters")} for each in opened.metadata.get("effects", [])
        ],
    }


def _pack(root: Path, out: Path) -> None:
    temporary = out.with_name(f".{out.name}.new")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
            for path in sorted(root.rglob("*")):
                if path.is_file():
                    archive.write(path, path.relative_to(root).as_posix())
        temporary.replace(out)
    except OSError as error:
        raise UserError(f"{out}: {error.strerror}; nothing was left behind") from None
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()
