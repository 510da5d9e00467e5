"""The bench of each kind of source."""

from tests.sources.bench import bench

__all__ = ["bench"]
