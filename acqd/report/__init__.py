"""Self-contained HTML pages for people: verdict first, one picture, then the rest."""

from acqd.report.page import Page
from acqd.report.verdict import KeyFigure, Verdict

__all__ = ["KeyFigure", "Page", "Verdict"]
