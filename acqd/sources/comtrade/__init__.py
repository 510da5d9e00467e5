"""COMTRADE recordings (IEEE C37.111-1991, -1999 and -2013; the last is IEC 60255-24)."""

from acqd.sources.comtrade.load import load

__all__ = ["load"]
