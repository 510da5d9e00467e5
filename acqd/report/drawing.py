"""Matplotlib figures as inline SVG that follows the page: its font, its colours, light or dark."""

from __future__ import annotations

import html
import io
import re
import warnings
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_THEMED = {
    "#000000": "var(--ink)", "#ffffff": "var(--paper)", "#b0b0b0": "var(--line)", "#cccccc": "var(--line)",
    "#b45309": "var(--before)", "#d97706": "var(--before)", "#d9480f": "var(--before)",
    "#1d6fa5": "var(--after)", "#2563eb": "var(--after)", "#3b82c4": "var(--after)",
    "#9aa5b1": "var(--muted)", "#52606d": "var(--muted)", "#64748b": "var(--muted)", "#94a3b8": "var(--muted)",
    "#059669": "var(--fine)", "#d8f3dc": "var(--fine-wash)", "#7c3aed": "var(--other)",
}  # fmt: skip
"""Colours of the figures, and the variables of style.css that replace them."""
_COLOUR = re.compile("|".join(_THEMED))
_STYLE: Any = {"svg.fonttype": "none", "svg.hashsalt": "acqd", "path.simplify_threshold": 0.3}
_METADATA = {"Date": None, "Creator": None, "Format": None, "Type": None}
_IDENTIFIER = re.compile(r'\b(id="|href="#|url\(#)')
_UNUSED_GROUP = re.compile(r'<g id="(?!p[0-9a-f]{10})[^"]*"')


def inline_svg(figure: Figure, alt: str, mark: str) -> str:
    """The figure as an SVG element with an alternative text; `mark` begins its identifiers.

    Pictures within the figure, such as rasterised points, are embedded.
    """
    from matplotlib import rc_context

    buffer = io.StringIO()
    with rc_context(_STYLE), warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph .* missing from", UserWarning)  # text stays text: the page's font
        figure.savefig(buffer, format="svg", dpi=130, bbox_inches="tight", transparent=True, metadata=_METADATA)
    return themed(buffer.getvalue(), alt, mark)


def themed(document: str, alt: str, mark: str) -> str:
    """The SVG element of a document as matplotlib writes it, with the page's colours and its own identifiers."""
    element = "<svg" + document.partition("<svg")[2]
    element = re.sub(r"<metadata>.*?</metadata>", "", element, flags=re.DOTALL)
    element = re.sub(r' xmlns(:\w+)?="[^"]*"', "", element)  # HTML needs none
    element = _UNUSED_GROUP.sub("<g", element)
    element = _IDENTIFIER.sub(lambda match: f"{match.group(1)}{mark}-", element)
    element = _COLOUR.sub(lambda match: _THEMED[match.group()], element)
    width = re.search(r'width="([\d.]+)pt"', element)
    size = f"--width: {float(width.group(1)):.0f}pt" if width else ""
    element = re.sub(r'(<svg[^>]*?) (?:width="[\d.]+pt"|height="[\d.]+pt")', r"\1", element, count=1)
    element = re.sub(r'(<svg[^>]*?) (?:width="[\d.]+pt"|height="[\d.]+pt")', r"\1", element, count=1)
    return element.replace("<svg", f'<svg role="img" aria-label="{html.escape(alt)}" style="{size}"', 1)
