"""What a topic says meanwhile: a broker that is not there, and one that refuses."""

import pytest
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.reasoncodes import ReasonCode

from acqd.daemon.heard import Heard
from acqd.daemon.meter_ratio import judged
from acqd.errors import OperationError
from acqd.telemetry.mqtt import BrokerAddress
from tests.conftest import free_port


def test_a_broker_that_does_not_answer_is_the_reason_for_no_rows():
    heard = Heard(BrokerAddress("127.0.0.1", free_port()), "box", ["L1/power"], ["P"])
    heard.stop()
    with pytest.raises(OperationError, match=r"the broker at 127.0.0.1:[0-9]+ does not answer"):
        judged(heard, "box", None, None)


def test_a_broker_that_refuses_the_password_is_the_reason_for_no_rows():
    heard = Heard(None, "box", ["L1/power"], ["P"])
    assert heard.trouble == ""
    heard._subscribe(None, None, None, ReasonCode(PacketTypes.CONNACK, "Bad user name or password"), None)
    with pytest.raises(OperationError, match=r"refuses acqd doctor \(Bad user name or password\)"):
        judged(heard, "box", None, None)
