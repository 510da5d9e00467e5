"""Self-contained HTML pages with pictures, for people."""

from acqd.report.page import Page

__all__ = ["Page"]
