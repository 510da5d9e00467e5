"""A report as a single HTML file with text, tables and pictures: it needs no other file."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from acqd.errors import UserError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #1c2733; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.7rem; margin-bottom: .2rem; } h2 { font-size: 1.2rem; margin-top: 2.2rem; }
table { border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .8rem; text-align: right; border-bottom: 1px solid #d8dee5; }
th:first-child, td:first-child { text-align: left; }
figure { margin: 1.2rem 0; } img { max-width: 100%; height: auto; } figcaption { color: #52606d; font-size: .9rem; }
details { margin: 1.2rem 0; border-left: 3px solid #d8dee5; padding-left: 1rem; }
summary { cursor: pointer; font-weight: 600; }
.label { display: inline-block; background: #b45309; color: white; border-radius: .3rem; padding: 0 .5rem; }
"""


class Page:
    """A report under construction. All texts are HTML-escaped."""

    def __init__(self, title: str, *, simulated: bool) -> None:
        """`simulated` puts a conspicuous label on top."""
        label = '<p><span class="label">simulated data</span></p>' if simulated else ""
        self._title = title
        self._parts = [f"<h1>{html.escape(title)}</h1>{label}"]

    def heading(self, text: str) -> None:
        """Start a section."""
        self._parts.append(f"<h2>{html.escape(text)}</h2>")

    def text(self, text: str) -> None:
        """Add a paragraph."""
        self._parts.append(f"<p>{html.escape(text)}</p>")

    def table(self, header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
        """Add a table; floats are shown to four significant digits."""
        head = "".join(f"<th>{html.escape(name)}</th>" for name in header)
        body = "".join("<tr>" + "".join(f"<td>{_cell(cell)}</td>" for cell in row) + "</tr>" for row in rows)
        self._parts.append(f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>")

    def figure(self, figure: Figure, caption: str, png: Path | None = None) -> None:
        """Embed a matplotlib figure; with `png`, also save it as a file."""
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=130, bbox_inches="tight")
        if png is not None:
            png.write_bytes(buffer.getvalue())
        data = base64.b64encode(buffer.getvalue()).decode()
        text = html.escape(caption)
        self._parts.append(
            f'<figure><img alt="{text}" src="data:image/png;base64,{data}"><figcaption>{text}</figcaption></figure>'
        )

    def chapter(self, title: str, page: Path) -> None:
        """Embed another report as a part that is folded away. Raises UserError when it cannot be read."""
        try:
            text = page.read_text(encoding="utf-8")
        except OSError as error:
            raise UserError(f"{page}: cannot be read ({error.strerror})") from None
        inner = text.partition("<body>")[2].rpartition("</body>")[0]
        self._parts.append(f"<details><summary>{html.escape(title)}</summary>{inner}</details>")

    def write(self, path: Path) -> None:
        """Write the page. Raises UserError when the file cannot be written."""
        head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width"><style>{_STYLE}</style>'
        page = f"<!doctype html><html lang=en><head>{head}<title>{html.escape(self._title)}</title></head>"
        try:
            path.write_text(page + f"<body>{''.join(self._parts)}</body></html>\n", encoding="utf-8")
        except OSError as error:
            raise UserError(f"{path}: cannot be written ({error.strerror}); choose another --out") from None


def _cell(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else html.escape(str(value))
