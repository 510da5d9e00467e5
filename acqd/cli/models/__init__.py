"""`acqd train`, `acqd compare`, `acqd predict`."""

from acqd.cli.models.compare import compare
from acqd.cli.models.predict import predict
from acqd.cli.models.train import train

__all__ = ["compare", "predict", "train"]
