"""The `acqd` command: argument handling and printing, nothing else."""

import os

# Before numpy is loaded: windows are far too small for a BLAS with several threads. Its waiting threads
# would cost more than all the metering.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
