"""Systems below a folder, in which services are installed."""

from __future__ import annotations

import os
import shutil
import stat

import pytest

from tests.commands import acqd_here

NEEDS = [
    pytest.mark.skipif(os.geteuid() != 0, reason="users and owners need root"),
    pytest.mark.skipif(shutil.which("systemd-sysusers") is None, reason="no systemd here"),
]


def contents(root):
    """Files with their text, mode and owners."""
    by_the_way = (".pwd.lock", "passwd-", "group-", "shadow-", "gshadow-")
    files = [path for path in sorted(root.rglob("*")) if path.is_file() and path.name not in by_the_way]
    return {
        f"/{path.relative_to(root)}": (path.read_bytes(), stat.S_IMODE(path.stat().st_mode), path.stat().st_gid)
        for path in files
    }


def installed(root, *options):
    done = acqd_here("service", "install", "--root", root, "--program", "/bin/true", *options)
    assert done.returncode == 0, done.stderr
    return done.stdout


def bare(folder):
    """Make a folder a system where mosquitto is installed."""
    (folder / "etc").mkdir()
    (folder / "etc" / "group").write_text("root:x:0:\nmosquitto:x:117:\n")
    return folder
