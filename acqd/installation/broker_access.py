"""Access to mosquitto: its configuration, users with passwords, and who may do what."""

from __future__ import annotations

import base64
import hashlib
import os
import secrets

from acqd.installation.shared_files import shared_text

SINK, SIDECAR, BRIDGE = "acqd-sink", "acqd-sidecar", "acqd-bridge"
VIEWER, OPERATOR = "viewer", "operator"
_ITERATIONS = 101  # mosquitto's


def new_password() -> str:
    """32 random characters."""
    return secrets.token_urlsafe(24)


def password_line(user: str, password: str) -> str:
    """A line of mosquitto's password file: PBKDF2 with SHA-512, as mosquitto_passwd writes it."""
    salt = os.urandom(12)
    digest = hashlib.pbkdf2_hmac("sha512", password.encode(), salt, _ITERATIONS)
    return f"{user}:$7${_ITERATIONS}${base64.b64encode(salt).decode()}${base64.b64encode(digest).decode()}"


def with_passwords(text: str, passwords: dict[str, str]) -> str:
    """The password file with further users; whoever is in it already keeps the line."""
    lines = text.splitlines()
    present = {line.partition(":")[0] for line in lines}
    lines += [password_line(user, password) for user, password in passwords.items() if user not in present]
    return "\n".join([*lines, ""])


def broker_configuration() -> str:
    """The shipped configuration of a broker on this computer, with passwords."""
    text = shared_text("config/mosquitto.conf").replace("allow_anonymous true", "allow_anonymous false")
    return f"{text.rstrip()}\npassword_file /etc/mosquitto/acqd.passwords\nacl_file /etc/mosquitto/acqd.acl\n"
