"""A report as a single HTML file: verdict, one picture, contents, sections, footer. It needs no other file."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from acqd.atomic import replace_file
from acqd.errors import UserError
from acqd.report.arm_view import ArmView, asset, scripts
from acqd.report.bars import Bars
from acqd.report.blocks import Block, Chapter, Folded, Lines, Picture, Ranking, Section, Text, table_of
from acqd.report.chain import EMPTY
from acqd.report.digits import unbroken
from acqd.report.drawing import inline_svg
from acqd.report.footer import provenance
from acqd.report.head import Head, require_kind
from acqd.report.joint_names import with_joint_names
from acqd.report.lines import Chart
from acqd.report.verdict import Verdict

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WHOLE = re.compile(
    r"\b\d{4}-\d\d(?:-\d\d)?(?:[ T]\d\d:\d\d(?::\d\d(?:\.\d+)?)?Z?)?(?![\w-])|(?<![\w-])--?[a-z][a-z-]*(?![\w-])"
)
"""A month, a day, or a time of a day; an option of a command: browsers break lines at hyphens."""


class Page:
    """A report under construction. All texts are HTML-escaped."""

    def __init__(
        self, title: str, *, simulated: bool, kind: str = "page", subject: str = "", joints: Sequence[str] = ()
    ) -> None:
        """`simulated` puts a conspicuous label on top; `kind` and `subject`: what the page is, of which robot.

        `joints`: names that stand in the place of joint 1, joint 2 ...
        """
        self._title = title
        self._simulated = simulated
        self._kind, self._subject, self._joints = kind, subject, joints
        self._verdict: Verdict | None = None
        self._opening: list[Block] = []
        self._sections: list[Section] = []
        self._details: dict[str, str] = {}
        self._blocks = self._opening
        self._pictures = self._tables = 0
        self._footnotes: list[str] = []

    def verdict(self, verdict: Verdict) -> None:
        """Set the tile on top."""
        self._verdict = verdict

    def detail(self, name: str, value: object) -> None:
        """Add a row to the footer: a seed, an input, its hash."""
        self._details[name] = str(value)

    def heading(self, text: str) -> None:
        """Start a section. A section without content is left out."""
        anchor = f"s{len(self._sections) + 1}-" + re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")
        self._sections.append(Section(text, anchor))
        self._blocks = self._sections[-1].blocks

    def text(self, text: str) -> None:
        """Add a paragraph."""
        self._blocks.append(Text(text))

    def table(self, header: Sequence[str], rows: Sequence[Sequence[object]], *, sortable: bool = False) -> None:
        """Add a table; floats are shown to three significant digits. `sortable`: readers may sort and filter it."""
        self._tables += 1
        label = f"Table {self._tables}: {', '.join(name for name in header if name)}"
        self._blocks.append(table_of(label, header, rows, sortable=sortable))

    def lines(self, chart: Chart, caption: str, source: str = "") -> None:
        """Add a chart that shows the values below the pointer; `source` becomes a footnote."""
        self._blocks.append(Lines(chart.thinned(), self._noted(caption, source)))

    def bars(self, bars: Bars, caption: str) -> None:
        """Add a ranking."""
        self._blocks.append(Ranking(bars, caption))

    def figure(self, figure: Figure, caption: str, png: Path | None = None, alt: str = "", source: str = "") -> None:
        """Add a matplotlib figure, with an alternative text (default: its caption); with `png`, also save it there.

        `source`, such as a figure of a publication, becomes a footnote.
        """
        caption = self._noted(caption, source)
        if png is not None:
            figure.savefig(png, format="png", dpi=130, bbox_inches="tight")
        self._pictures += 1
        self._blocks.append(
            Picture(
                inline_svg(figure, alt or caption, f"f{self._pictures}"), f"Figure {self._pictures}: {caption}", caption
            )
        )

    def arm(self, view: ArmView) -> None:
        """Add an arm in motion with its power; three.js comes with the page, compressed."""
        self._blocks.append(view)

    def _noted(self, caption: str, source: str) -> str:
        if not source:
            return caption
        self._footnotes.append(source)
        return f"{caption} [{len(self._footnotes)}]"

    @contextmanager
    def folded(self, title: str) -> Iterator[None]:
        """Put what follows behind a title that opens it."""
        outside, inside = self._blocks, Folded(title)
        self._blocks = inside.blocks
        yield
        self._blocks = outside
        if inside.blocks:
            outside.append(inside)

    def chapter(self, title: str, page: Path) -> None:
        """Embed another report as a part that is folded away. Raises UserError when it cannot be read."""
        try:
            text = page.read_text(encoding="utf-8")
        except OSError as error:
            raise UserError(f"{page}: cannot be read ({error.strerror})") from None
        self._pictures += 1
        inner = text.partition("<main>")[2].rpartition("</main>")[0]
        inner = re.sub(r"<nav .*?</nav>", "", inner, flags=re.DOTALL)  # contents of a part are no landmark of the page
        inner = re.sub(r'<figure class="moving">.*?</figure>', "", inner, flags=re.DOTALL)  # scripts are not in main
        mark = f"c{self._pictures}-"
        inner = re.sub(r'\b(id="|href="#|url\(#|aria-labelledby=")', rf"\g<1>{mark}", inner)
        self._blocks.append(Chapter(title, re.sub(r"(</?)h[12]\b", r"\1h3", inner)))

    def _arm_scripts(self) -> dict[str, str]:
        blocks = [*self._opening, *(block for section in self._sections for block in section.blocks)]
        return scripts() if any(isinstance(block, ArmView) for block in blocks) else {}

    def write(self, path: Path) -> None:
        """Write the page, in the place of an earlier one of its kind at most. Raises UserError."""
        require_kind(path, self._kind)
        try:
            replace_file(path, self.html().encode())
        except OSError as error:
            raise UserError(f"{path}: cannot be written ({error.strerror}); choose another --out") from None

    def html(self) -> str:
        """The page."""
        origin = provenance(self._details)
        head = Head(
            self._title, self._kind, self._subject, origin["written"], origin["by"], self._simulated,
            self._verdict or Verdict("fine", ""),
        )  # fmt: skip
        text = str(
            _template().render(
                title=self._title, simulated=self._simulated, verdict=self._verdict, opening=self._opening,
                sections=[section for section in self._sections if section.blocks], head=head.as_script(), pages=EMPTY,
                footnotes=self._footnotes,
                provenance=origin, style=asset("style.css"), script=asset("script.js"), arm=self._arm_scripts(),
            )
        )  # fmt: skip
        return with_joint_names(text, [escape(name).replace("\\", "&#92;") for name in self._joints])


def _printed(value: object) -> object:
    """What the template prints: no line ends inside a number with its unit, or a moment; markup as it is."""
    if type(value) is not str:
        return value
    from markupsafe import Markup

    whole = _WHOLE.sub(r'<span class="whole">\g<0></span>', escape(unbroken(value)))
    return Markup(whole)  # noqa: S704  # escaped


def _plain(value: object) -> object:
    """Of an attribute, which holds no markup."""
    from markupsafe import Markup

    return Markup(escape(unbroken(str(value))))  # noqa: S704  # escaped


@cache
def _template() -> Any:
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True, finalize=_printed)
    environment.filters["unbroken"] = unbroken
    environment.filters["plain"] = _plain
    return environment.from_string(asset("page.html"))
