"""Where the compiled cycles of MAIN_FAST are: asked by MAIN_SLOW, so that MAIN_FAST holds no compiler driver."""

from __future__ import annotations

import functools
import logging
import os

from acqd.c_builds import ticks
from acqd.compiling import cached_library, loaded_library
from acqd.errors import OperationError

_log = logging.getLogger(__name__)
SWITCH = "ACQD_TICKS"
"""Environment variable: "python" for cycles without C."""


@functools.cache
def library_path() -> str | None:
    """File of the compiled cycles; None, and one line in the log, without a compiler or where the file is damaged."""
    if os.environ.get(SWITCH) == "python":
        return None
    try:
        loaded_library(ticks())  # a damaged file is known here, and not in MAIN_FAST
        return str(cached_library(ticks()))
    except OperationError as error:
        _log.warning("cycles of MAIN_FAST in Python, which takes about twice as long: %s", error)
        return None
