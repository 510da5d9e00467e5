"""The site by MkDocs: the pages of docs/, the generated references, and a navigation."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from acqd.errors import OperationError
from acqd.extras import require
from tools.docs.reference import ROOT, pages

_DOCS = ROOT / "docs"
NAVIGATION: dict[str, list[str]] = {
    "Start": ["index.md", "first-ten-minutes.md", "python.md", "compared.md"],
    "Measure": [
        *("sources.md", "waveforms.md", "rows.md", "quality.md", "conformance.md", "en50160.md", "events.md"),
        *("archive.md", "service.md", "web.md"),
    ],
    "Operate": ["operations.md", "security.md", "scaling.md", "peers.md", "sidecar.md", "integrations.md"],
    "Model": ["robots.md", "dataset.md", "models.md", "fmu.md"],
    "Close the loop": ["closing-the-loop.md", "fleet.md"],
    "Evidence": ["lab.md", "measured-robots.md", "thesis.md"],
    "Reference": [f"reference/{name}.md" for name in ("commands", "configuration", "report", "api")],
    "Inside": ["architecture.md"],
}
"""Headings and their pages; a page of docs/ that is not named comes under "More"."""


def build_site(out: Path) -> None:
    """Write the site into the folder `out`. A warning of MkDocs is an error. Raises OperationError, UserError."""
    require("make docs", ("mkdocs", "material"), "docs")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lay_out(folder / "docs")
        configuration = folder / "mkdocs.yml"
        configuration.write_text(json.dumps(settings(folder / "docs", out.resolve())), encoding="utf-8")
        command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--clean", "--config-file", str(configuration)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        complaints = [line for line in done.stderr.splitlines() if "WARNING" in line or "ERROR" in line]
        raise OperationError("mkdocs: " + "; ".join(complaints or done.stderr.splitlines()[-3:]))


def lay_out(folder: Path) -> None:
    """The pages as MkDocs reads them: links that leave docs/ become text, README.md the first page."""
    shutil.copytree(_DOCS, folder)
    for path in folder.rglob("*.md"):
        path.write_text(_within(path.read_text(encoding="utf-8")), encoding="utf-8")
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    readme = re.sub(r"\]\(docs/(adr)/\)", r"](\1/0001-frequency-by-harmonic-least-squares.md)", readme)
    readme = re.sub(r"\]\(docs/", "](", readme)
    (folder / "index.md").write_text(
        _within(re.sub(r"\[([^\]]*)\]\([A-Z]\w*(\.md)?\)", r"`\1`", readme)), encoding="utf-8"
    )
    for name, text in pages().items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")


def _within(text: str) -> str:
    """Without links to files outside docs/."""
    outside = r"\[([^\]]*)\]\((?:\.\./)*(?:\.\./)?(?:config|tools|tests|acqd|systemd|examples)/[^)]*\)"
    return re.sub(outside, r"\1", text)


def settings(docs: Path, out: Path) -> dict[str, Any]:
    """mkdocs.yml; JSON is YAML."""
    named = {page for group in NAVIGATION.values() for page in group}
    navigation: list[Any] = [
        {heading: [page for page in group if (docs / page).exists()]} for heading, group in NAVIGATION.items()
    ]
    more = sorted(path.name for path in docs.glob("*.md") if path.name not in named)
    folders = {"Decisions": "adr", "Wiring": "twincat", "Bridge": "modbus-bridge", "Pictures": "pictures"}
    for heading, folder in folders.items():
        found = sorted(str(path.relative_to(docs)) for path in (docs / folder).glob("*.md"))
        navigation.append({heading: found})
    return {
        "site_name": "acqd",
        "docs_dir": str(docs),
        "site_dir": str(out),
        "use_directory_urls": False,
        "theme": {
            "name": "material",
            "font": False,
            "features": ["navigation.indexes", "content.code.copy"],
            "palette": [
                {"scheme": "default", "media": "(prefers-color-scheme: light)"},
                {"scheme": "slate", "media": "(prefers-color-scheme: dark)"},
            ],
        },
        "markdown_extensions": [
            "tables",
            "footnotes",
            "attr_list",
            "pymdownx.superfences",
            {"toc": {"permalink": True}},
        ],
        "plugins": ["search"],
        "nav": [*navigation, *([{"More": more}] if more else [])],
    }
