"""Fuzzing by coverage with atheris: inputs that reach new lines of acqd are kept and mutated further. By hand only."""

from __future__ import annotations

import importlib
import sys
import tempfile
from pathlib import Path

from acqd.errors import UserError
from tools.studies.fuzz.judge import outcome
from tools.studies.fuzz.targets import target

_MODULES = (
    "acqd.sources.csv_file", "acqd.sources.npz_file", "acqd.sources.audio_file", "acqd.sources.comtrade",
    "acqd.telemetry.row", "acqd.daemon.config_file", "acqd.robot.table_text", "acqd.robot.log_reader",
    "acqd.sidecar.log_file", "acqd.models.bundle.restore", "acqd.dataset.power_files",
    "acqd.sources.sampled_values.frame",
)  # fmt: skip


def fuzz_by_coverage(name: str, inputs: int, seed: int, seconds: float) -> None:
    """Runs until a failure, which libFuzzer reports with its input, or for `inputs` inputs. Raises UserError."""
    try:
        import atheris
    except ModuleNotFoundError:
        raise UserError("--guided needs atheris: pip install atheris") from None
    for module in _MODULES:  # the command has loaded some already: a second time, with counters
        with atheris.instrument_imports(include=[module]):
            importlib.reload(importlib.import_module(module))
    parser = target(name)
    seeds = parser.seeds()
    file = max(seeds[0], key=lambda one: len(seeds[0][one]) if one != "weights.safetensors" else 0)

    def one_input(content: bytes) -> None:
        end = outcome(parser, {**seeds[0], file: content}, seconds)
        if end.kind == "failure":
            raise RuntimeError(end.reason)

    corpus = tempfile.mkdtemp(prefix="acqd-corpus-")
    for number, files in enumerate(seeds):
        (Path(corpus) / str(number)).write_bytes(files[file])
    atheris.Setup([sys.argv[0], f"-runs={inputs}", f"-seed={seed}", "-max_len=20000", corpus], one_input)
    atheris.Fuzz()
