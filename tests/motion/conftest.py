"""A cell of the laboratory, and trajectories drawn in it."""

from tests.lab.conftest import cell, drawn

__all__ = ["cell", "drawn"]
