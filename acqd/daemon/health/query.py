"""Asks the services of this computer how they are."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from http.client import HTTPConnection, HTTPException
from typing import Any, Literal

from acqd.daemon.health.section import HealthSection

_TIMEOUT_S = 3.0
Service = Literal["daemon", "sink"]
SERVICES: tuple[Service, ...] = ("daemon", "sink")


@dataclass(frozen=True, slots=True)
class Answer:
    """What a service said; `status` is empty when it did not answer."""

    service: Service
    ready: bool
    problems: list[str]
    notes: list[str]
    status: dict[str, Any] = field(default_factory=dict)


def ask(section: HealthSection, service: Service, *, acknowledge: bool = False) -> Answer | None:
    """The status of a service; None when the configuration gives it no port.

    `acknowledge`: a person has seen the problems that were counted until now.
    """
    port = section.port if service == "daemon" else section.sink_port
    if not port:
        return None
    host = f"[{section.host}]" if ":" in section.host else section.host
    where = f"http://{host}:{port}/status"
    try:
        status = _get(section.host, port, acknowledge=acknowledge)
        answered = status["service"]
        if answered != service:
            return Answer(
                service, False, [f"the {answered} answers at {where}; check [health] in the configuration"], []
            )
        return Answer(service, status["ready"] is True, list(status["problems"]), list(status["notes"]), status)
    except OSError as error:
        reason = error.strerror or str(error) or type(error).__name__
        return Answer(service, False, [f"no answer at {where} ({reason}); is the service running?"], [])
    except (HTTPException, ValueError, KeyError, TypeError):
        return Answer(service, False, [f"what answers at {where} is no {service} of acqd"], [])


def _get(host: str, port: int, *, acknowledge: bool) -> dict[str, Any]:
    connection = HTTPConnection(host, port, timeout=_TIMEOUT_S)
    try:
        connection.request(*(("POST", "/acknowledge") if acknowledge else ("GET", "/status")))
        answer = connection.getresponse()
        body: dict[str, Any] = json.loads(answer.read(1 << 20))
        return body
    finally:
        connection.close()
