"""Which slaves of a segment are the configured terminals."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from acqd.errors import UserError
from acqd.sources.ethercat import objects
from acqd.sources.ethercat.settings import EthercatSettings

pytest.importorskip("pysoem")
from acqd.sources.ethercat.bus import SegmentError
from acqd.sources.ethercat.configure import find_terminals

COUPLER, TERMINAL, OTHER, UNREAD = (2, 0x044C2C52), (2, objects.EL3783), (2, 0x0EBD3052), (0, 0)


def found(*slaves):
    made = [SimpleNamespace(man=vendor, id=product, rev=0, name="") for vendor, product in slaves]
    master = SimpleNamespace(config_init=lambda: len(made), slaves=made)
    return [made.index(slave) for slave in find_terminals(master, EthercatSettings("eth0", terminals=1))]


def test_a_slave_whose_identity_was_lost_is_worth_another_try_where_a_terminal_is_missing():
    assert found(COUPLER, TERMINAL) == [1]
    assert found(COUPLER, TERMINAL, UNREAD) == [1], "a slave with an empty EEPROM that nobody needs"
    with pytest.raises(SegmentError, match="slave 2 does not say what it is"):
        found(COUPLER, UNREAD)
    with pytest.raises(SegmentError, match=r"expected 1 EL3783 .*found 0 .*check power"):
        found(COUPLER)
    for slaves in ((COUPLER, OTHER), (COUPLER, TERMINAL, TERMINAL, UNREAD)):
        with pytest.raises(UserError, match="expected 1 EL3783"):
            found(*slaves)
