"""Recordings as text: tables that instruments and programs export, by described layouts."""

from acqd.sources.text.load import load

__all__ = ["load"]
