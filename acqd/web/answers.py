"""Headers of every answer, and JSON."""

from __future__ import annotations

import orjson
from starlette.responses import Response

_POLICY = "default-src 'self'; img-src 'self' data:; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'"
HEADERS = {
    "content-security-policy": _POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
}
NOT_KEPT = HEADERS | {"cache-control": "no-store"}


def as_response(content: object, status: int = 200) -> Response:
    """JSON of a value, or a body that is JSON already."""
    body = content if isinstance(content, bytes) else orjson.dumps(content)
    return Response(body, status, NOT_KEPT, "application/json")
