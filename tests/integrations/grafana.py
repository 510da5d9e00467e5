"""What Grafana makes of the queries of a dashboard before it sends them."""

from __future__ import annotations

import json
import re
from datetime import UTC, datetime
from typing import Any

from tests.places import ROOT

DASHBOARD = ROOT / "config" / "grafana" / "dashboards" / "acqd.json"


def panels() -> list[dict[str, Any]]:
    return list(json.loads(DASHBOARD.read_text())["panels"])


def sql(text: str, begin: int, end: int, **variables: str) -> str:
    """A query with its macros and variables replaced as Grafana's documentation says; `begin`, `end`: Unix s."""
    for name, value in variables.items():
        text = text.replace(f"${{{name}:sqlstring}}", value)
    first, last = (f"'{datetime.fromtimestamp(each, UTC):%Y-%m-%dT%H:%M:%SZ}'" for each in (begin, end))
    text = re.sub(r"\$__timeFilter\(([^)]*)\)", rf"\1 BETWEEN {first} AND {last}", text)
    text = re.sub(r"\$__unixEpochFilter\(([^)]*)\)", rf"\1 >= {begin} AND \1 <= {end}", text)
    text = re.sub(r"\$__timeGroup\(([^,]*), *\$__interval\)", r"floor(extract(epoch from \1)/10)*10", text)
    text = text.replace("$__unixEpochFrom()", str(begin)).replace("$__unixEpochTo()", str(end))
    assert "$" not in text, f"left in the query: {text}"
    return text
