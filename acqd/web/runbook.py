"""The runbook's lines about the services' health as a page, so that it can be read offline."""

from __future__ import annotations

import re
from html import escape

from acqd.daemon.health.runbook import RUNBOOK

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>acqd: what to do</title><link rel="icon" href="data:,"><link rel="stylesheet" href="/assets/page.css"></head>
<body><main><h1>What to do</h1><p><a href="/">back to the live page</a></p>
<dl class="runbook">{lines}</dl></main></body></html>
"""


def runbook_page() -> str:
    """HTML with one anchor per line."""
    lines = (
        f'<div id="{entry.anchor}"><dt>{_marked(entry.symptom)}</dt><dd>{_marked(entry.steps)}</dd></div>'
        for entry in RUNBOOK
    )
    return _PAGE.format(lines="".join(lines))


def _marked(text: str) -> str:
    """Code between backticks, as in the document; of a link to another document its name."""
    plain = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", escape(text, quote=False))
    return re.sub(r"`([^`]*)`", r"<code>\1</code>", plain)
