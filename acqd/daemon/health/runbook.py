"""Which line of the runbook mends a problem: docs/operations.md in short, for pages that work offline."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Entry:
    """One line of the runbook."""

    anchor: str
    symptom: str
    """As in docs/operations.md."""
    steps: str
    pattern: re.Pattern[str]
    """Sentences of /status that mean this symptom; `doctor: CHECK` for a check of `acqd doctor`."""

    @property
    def link(self) -> str:
        """Place in the documentation."""
        return f"docs/operations.md#{self.anchor}"

    @property
    def plain_steps(self) -> str:
        """The steps without the marks of the document, for a terminal."""
        return re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", self.steps).replace("`", "")


def _entry(anchor: str, symptom: str, steps: str, pattern: str) -> Entry:
    return Entry(anchor, symptom, steps, re.compile(pattern))


RUNBOOK = (
    _entry(
        "no-answer",
        "`daemon: no answer at ...`",
        "`systemctl status acqd acqd-sink`: are both running? Another program on the port: `[health] port`",
        r"no answer at|what answers at|answers at http|^doctor: ports",
    ),
    _entry(
        "no-rows",
        "`no rows for ... s`",
        "the log: MAIN_FAST or the source; systemd restarts the daemon after `WatchdogSec`",
        r"no rows|the sink hangs",
    ),
    _entry(
        "source-away",
        "`source away: ...`, log: `source: ...; trying again`",
        "the sentence says what to check; the daemon reconnects by itself",
        r"^source( of .+)? away",
    ),
    _entry(
        "source-trouble",
        "rows flagged `invalid` or `sync_error`",
        "`source.trouble`: range, synchronisation or a sensor",
        r"^source( of .+)?: ",
    ),
    _entry(
        "source-again",
        "`source of ... was started again`",
        "`journalctl -u acqd`: why the source failed; its rows have another boot since",
        r"^source of .+ was started again",
    ),
    _entry(
        "main-fast",
        "log: `MAIN_FAST: signal 9; relaunching it`",
        "`dmesg` for the OOM killer; `systemctl show acqd -p MemoryMax`",
        r"^MAIN_FAST( of .+)? was relaunched",
    ),
    _entry(
        "clock",
        "rows flagged `unsynchronised`",
        "`chronyc tracking` or `timedatectl`: nobody disciplines the clock",
        r"clock is not synchronised|^doctor: time synchronisation",
    ),
    _entry(
        "name-taken",
        "`name taken: ...`, or `broker away: connections end within seconds`",
        "two daemons of one name: the sentence names the other; give each a `device`, or `acqd run --take-name` once. "
        "Of a sink: two of one `[sink] client_id`, and each stores what comes while it is connected; give each another "
        "one",
        r"name taken|connections end within seconds",
    ),
    _entry(
        "broker-away",
        "`broker away: ...`",
        "the sentence says why; `systemctl status mosquitto`; rows wait. `not authorized`: `sudo acqd config check "
        "--connect` names the user; delete `/etc/acqd/USER.password`, and `sudo acqd service install` makes another "
        "password",
        r"broker away",
    ),
    _entry(
        "upkeep",
        "`maintenance: ...` (sink)",
        "is the clock of this computer right (`timedatectl`)? Then `acqd sink maintain --yes`; else set it",
        r"^maintenance",
    ),
    _entry(
        "sink-clock",
        "`this computer's clock ...`, rows flagged `sink_clock`",
        "`timedatectl`, `chronyc tracking` on both computers: set the clock that is wrong; no row is lost",
        r"^this computer's clock",
    ),
    _entry(
        "earlier-state",
        "`N times the database was found in an earlier state`, `... the database of a sink was found ...` (daemon)",
        "who restored it? Daemons sent the rows of `keep_minutes` again; `acqd sink completeness` shows gaps",
        r"earlier state",
    ),
    _entry(
        "slow",
        "`database slow: ...`",
        "the disk or the server of the database: `iostat -x 1`; other programs that hold locks",
        r"^database slow",
    ),
    _entry(
        "filling",
        "`disk of the database full in ... days`",
        "lower `keep_days` in `[sink]`, or a larger disk; without `keep_days`, an SQLite database stops growing at "
        "nine tenths of its disk",
        r"^disk of the database",
    ),
    _entry(
        "certificate",
        "`certificate ... ends in ... days`",
        "make another one (`config/make-certificates.sh`) and copy it to its place; services read it, and see that of "
        "the broker, when they connect",
        r"^certificate |^doctor: certificates",
    ),
    _entry(
        "receipts",
        "`no receipt for ... s although a sink is online`, `rows refused: ...`",
        "`acqd status` of the sink: is its database away? Else the broker's access rules: may the daemon write "
        "`acqd/DEVICE/#`, and the sink read it and write receipts? Its limits: `message_size_limit`",
        r"^(no receipt|rows refused)",
    ),
    _entry(
        "receipts-late",
        "`receipts late: ...`",
        "`acqd status` of the sink: is its database slow? Else the broker: its load, its subscribers",
        r"^receipts late",
    ),
    _entry(
        "copies",
        "`spool: ... is no file of this spool, and nobody delivers what it holds`",
        "delete the copy; a renamed segment gets its number back while acqd is stopped",
        r"^spool: .*is no file of this spool",
    ),
    _entry(
        "deleted",
        "`N times somebody deleted or changed files of the spool`",
        "who cleans or rotates `state_dir`? Exclude it; `acqd sink completeness` shows gaps; then "
        "`acqd status --acknowledge`",
        r"deleted or changed files of the spool",
    ),
    _entry(
        "power-cut",
        "`N power cuts or restored backups before this start ...`, `W of ... began at ...`",
        "`acqd sink completeness`; rows flagged `W_unconfirmed`: W may be behind; then `acqd status --acknowledge`",
        r"restored backups? before this start|^W.* began at .* kWh",
    ),
    _entry(
        "left-behind",
        "`spool: N rows of device ... wait in ..., and nobody delivers them`",
        "the device was renamed: start acqd with the old `device` until `acqd status` says 0 wait, then rename again",
        r"^spool: .*(nobody delivers|of another name wait)",
    ),
    _entry(
        "unreadable",
        "`spool: ... cannot be read: ...`, `... does not confirm rows: ...`, `energy register: ...`",
        "the disk, share or mount of `state_dir`; no row is deleted, and the disk is tried again",
        r"^spool: .*(cannot be (read|opened)|does not confirm)|^energy register: ",
    ),
    _entry(
        "no-sink",
        "`no sink is known, and ... rows wait`",
        "`journalctl -u acqd-sink`; the broker's access rules: the daemon reads `acqd/sink/+/status`",
        r"^no sink is known",
    ),
    _entry(
        "spool",
        "`N messages were dropped`",
        "the spool is full: `max_mb` in `[spool]`; or its disk is; `acqd status --acknowledge` when you have seen it",
        r"spool|messages were dropped",
    ),
    _entry(
        "archive",
        "`archive: ...`, doctor: `archive`",
        "the disk of `[archive] folder`: room, mount, owner; rows go on, and `acqd archive list` names every gap",
        r"^archive: |^doctor: archive",
    ),
    _entry(
        "database-away",
        "`database away: ...` (sink)",
        "the sentence is the database's; rows wait with the broker. `disk I/O error` with a healthy disk: a program "
        "has the index of a write-ahead log open that was deleted; `fuser FILE`, close it",
        r"database away|^doctor: database",
    ),
    _entry(
        "rows-refused",
        "`the database refuses rows of ...`, `refused rows: ...`",
        "the sentence is the database's: a constraint, trigger, column or partition that acqd has not made. Rows wait "
        "with their daemons and come by themselves; copies in quarantine leave it within a minute then. There are "
        "copies until `quarantine_mb_per_day` is used; rows beyond it that nobody sends again are lost",
        r"^the database refuses rows|^(.*; )?refused rows: ",
    ),
    _entry(
        "quarantine",
        "log: `other rows with their keys are stored`",
        "`acqd sink quarantine list`: another client publishes as this device, or a clock is wrong; restore or drop",
        r"quarantine",
    ),
    _entry(
        "host",
        "doctor: `kernel`, `cpu governor`, `clocksource`",
        "a PREEMPT_RT kernel, governor `performance` and clock `tsc`; without them some wake-ups are late",
        r"^doctor: (kernel|cpu governor|clocksource)",
    ),
    _entry(
        "privileges",
        "doctor: `real-time priority`, `locked memory`, `raw network access`",
        "`systemd/acqd.service` grants them: `LimitRTPRIO`, `LimitMEMLOCK`, `AmbientCapabilities`",
        r"^doctor: (real-time priority|locked memory|raw network access)",
    ),
    _entry(
        "compiler",
        "doctor: `metering` is numpy",
        "`apt install gcc`; rows are right without it, a window takes longer",
        r"^doctor: metering",
    ),
    _entry(
        "device",
        "doctor: `source ...`",
        "what the finding names: cable, power, address, permission; [sources.md](sources.md) has each kind",
        r"^doctor: source",
    ),
    _entry(
        "broker-settings",
        "doctor: `broker`, `broker delay`, `broker user`, `secrets`",
        "`[mqtt]` of acqd.toml, `config/mosquitto.conf`; [security.md](security.md)",
        r"^doctor: (broker|secrets)",
    ),
    _entry(
        "state-dir",
        "doctor: `spool`",
        "`state_dir` in acqd.toml, or `StateDirectory=` of the unit, on a disk with room: rows then survive a restart",
        r"^doctor: spool",
    ),
    _entry(
        "disk",
        "doctor: `disk`",
        "free the disk, or `keep_days` in `[sink]` and `acqd sink maintain`; a week of four channels needs 6 GB",
        r"^doctor: disk",
    ),
)


def entry_for(sentence: str) -> Entry | None:
    """The line of the runbook for a problem or note of /status, or for `doctor: CHECK`."""
    of_doctor = sentence.startswith("doctor: ")
    for entry in RUNBOOK:
        match = entry.pattern.search(sentence)
        if match is not None and match[0].startswith("doctor: ") == of_doctor:  # words of /status are no checks
            return entry
    return None


def links_for(sentences: Iterable[str]) -> dict[str, str]:
    """Links of the sentences that have a line."""
    return {text: entry.link for text in sentences if (entry := entry_for(text))}
