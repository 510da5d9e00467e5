"""Scripts of others that acqd ships, put into the list of packages: python -m tools.vendored [acqd.cdx.json]."""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
SCRIPTS = (
    ("uplot", "1.6.32", "acqd/web/assets/uPlot.iife.min.js", "https://github.com/leeoniya/uPlot"),
    ("three", "0.187.0", "acqd/report/assets/three.min.js", "https://github.com/mrdoob/three.js"),
)
"""Name at npm, version, file, home; all are under the MIT licence, which lies beside the file."""


def components() -> list[dict[str, Any]]:
    """In the form of CycloneDX, with the hash of the file that is shipped."""
    return [
        {
            "bom-ref": f"npm:{name}@{version}", "type": "library", "name": name, "version": version,
            "purl": f"pkg:npm/{name}@{version}", "licenses": [{"license": {"id": "MIT"}}],
            "hashes": [{"alg": "SHA-256", "content": hashlib.sha256((ROOT / path).read_bytes()).hexdigest()}],
            "externalReferences": [{"type": "vcs", "url": home}],
            "properties": [{"name": "acqd:file", "value": path}],
        }
        for name, version, path, home in SCRIPTS
    ]  # fmt: skip


def add_to(path: Path) -> None:
    """Write the scripts into a list, in the place of earlier ones."""
    content = json.loads(path.read_text(encoding="utf-8"))
    others = [each for each in content["components"] if not each["bom-ref"].startswith("npm:")]
    content["components"] = others + components()
    path.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    add_to(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "acqd.cdx.json")
