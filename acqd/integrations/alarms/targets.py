"""Where notifications go: a webhook (HTTP POST of JSON) or e-mail (SMTP)."""

from __future__ import annotations

import smtplib
import ssl
from dataclasses import dataclass, field
from email.message import EmailMessage
from typing import Any, Protocol

import orjson

from acqd.integrations.alarms.section import AlarmsSection
from acqd.integrations.http import post

_TIMEOUT_S = 10.0
_PASSING = (408, 425, 429)
"""Refusals that another attempt may overcome; so may all of 500 and above."""


class RefusedError(Exception):
    """The target will never take this message."""


class Target(Protocol):
    """One receiver."""

    name: str
    """For the log and the state file: nothing secret."""

    def send(self, content: dict[str, Any]) -> None:
        """Deliver a notification. Raises RefusedError, or OSError when it is to be tried again."""


@dataclass(slots=True)
class Webhook:
    """An address that takes JSON."""

    url: str = field(repr=False)
    name: str

    def send(self, content: dict[str, Any]) -> None:
        """POST it."""
        headers = {"Content-Type": "application/json", "User-Agent": "acqd"}
        answer = post(self.url, orjson.dumps(content), headers)
        if answer.good:
            return
        failure = f"answer {answer.code} {answer.reason}"
        if 300 <= answer.code < 500 and answer.code not in _PASSING:
            raise RefusedError(failure)
        raise OSError(failure)


@dataclass(slots=True)
class Mail:
    """A mailbox, or several."""

    section: AlarmsSection = field(repr=False)
    name: str = "mail"

    def send(self, content: dict[str, Any]) -> None:
        """Send it as text with the JSON below."""
        section = self.section
        message = EmailMessage()
        message["Subject"] = str(content["text"])[:200].replace("\n", " ")
        message["From"], message["To"] = section.mail_from, ", ".join(section.mail_to)
        message["X-Acqd-Key"] = str(content["key"])
        shown = orjson.dumps(content, option=orjson.OPT_INDENT_2).decode()
        how = f"acqd alarms acknowledge {content['key']} --by YOUR-NAME"
        message.set_content(f"{content['text']}\n\nTo end the reminders: {how}\n\n{shown}\n")
        try:
            with self._connected() as server:
                server.send_message(message)
        except (smtplib.SMTPRecipientsRefused, smtplib.SMTPSenderRefused, smtplib.SMTPDataError) as error:
            if _permanent(error):
                raise RefusedError(str(error)[:200]) from None
            raise OSError(str(error)[:200]) from None
        except smtplib.SMTPException as error:
            raise OSError(str(error)[:200]) from None

    def _connected(self) -> smtplib.SMTP:
        section, context = self.section, ssl.create_default_context()
        where = (section.smtp_host, section.smtp_port)
        if section.smtp_tls == "tls":
            server: smtplib.SMTP = smtplib.SMTP_SSL(*where, timeout=_TIMEOUT_S, context=context)
        else:
            server = smtplib.SMTP(*where, timeout=_TIMEOUT_S)
        if section.smtp_tls == "starttls":
            server.starttls(context=context)
        if section.smtp_username is not None and section.smtp_password is not None:
            server.login(section.smtp_username, section.smtp_password)
        return server


def _permanent(error: smtplib.SMTPException) -> bool:
    """Whether the server's code is of the 500s: it will not take the message later either."""
    if isinstance(error, smtplib.SMTPRecipientsRefused):
        return all(code >= 500 for code, _ in error.recipients.values())
    return isinstance(error, smtplib.SMTPResponseException) and error.smtp_code >= 500


def targets_of(section: AlarmsSection) -> list[Target]:
    """The receivers of a configuration; webhooks are named by number, for their addresses may hold secrets."""
    targets: list[Target] = [Webhook(url, f"webhook {number}") for number, url in enumerate(section.webhooks, 1)]
    return [*targets, Mail(section)] if section.mail_to else targets
