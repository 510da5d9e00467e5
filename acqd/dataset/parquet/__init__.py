"""Recordings as Parquet files, without a library: columns of numbers, times and labels that have no empty cells."""

from acqd.dataset.parquet.read import OtherWriterError, read_parquet
from acqd.dataset.parquet.write import write_parquet

__all__ = ["OtherWriterError", "read_parquet", "write_parquet"]
