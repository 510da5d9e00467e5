"""MQTT packets: those that paho makes are read, those that we make are what paho reads."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.telemetry import wire
from acqd.telemetry.wire import V5, V311, Packets, ProtocolError, Publish


def packet(first, body):
    return bytes([first]) + wire._block(body)


def incoming(version, topic, payload, number, properties=b""):
    body = struct.pack("!H", len(topic)) + topic.encode() + (struct.pack("!H", number) if number else b"")
    body += wire._block(properties) if version == V5 else b""
    return packet(0x32 if number else 0x30, body + payload)


messages = st.lists(
    st.tuples(st.text("abc/", min_size=1, max_size=20), st.binary(max_size=400), st.integers(0, 65_535)), max_size=12
)


@given(messages, st.sampled_from([V311, V5]), st.lists(st.integers(1, 300), min_size=1, max_size=40))
@settings(max_examples=60)
def test_messages_are_cut_from_the_stream_wherever_it_breaks(sent, version, cuts):
    stream = b"".join(incoming(version, *one) + wire.PINGREQ for one in sent)
    packets, got, at = Packets(version, 1 << 16), [], 0
    for cut in cuts * (len(stream) // min(cuts) + 1):
        got += [body for kind, body in packets.feed(stream[at : at + cut]) if kind == wire.PUBLISH]
        at += cut
    assert got == [Publish(topic, payload, number) for topic, payload, number in sent]


@given(length=st.integers(200, 200_000), piece=st.integers(1, 70_000), version=st.sampled_from([V311, V5]))
@settings(max_examples=40)
def test_a_message_that_is_too_large_is_named_and_never_held(length, piece, version):
    stream = incoming(version, "a/b", b"x" * length, 7) + incoming(version, "a/c", b"next", 8)
    packets, got, held = Packets(version, 4096), [], 0
    for at in range(0, len(stream), piece):
        got += [body for _, body in packets.feed(stream[at : at + piece])]
        held = max(held, len(packets._data))
    large, after = got
    assert after == Publish("a/c", b"next", 8) and (large.topic, large.number) == ("a/b", 7)
    assert bool(large.oversized) == (length > 4096 - 10 or len(large.payload) < length)
    assert held <= 4096 + 8


@given(st.binary(max_size=200), st.sampled_from([V311, V5]))
def test_any_bytes_are_packets_or_an_error(data, version):
    packets = Packets(version, 4096)
    try:
        for kind, body in packets.feed(data):
            if kind == wire.CONNACK and isinstance(body, bytes):
                wire.connack(version, body)
    except ProtocolError:
        pass


@pytest.mark.parametrize("version", [V311, V5])
def test_refusals_are_named(version):
    code = 4 if version == V311 else 0x86
    assert wire.connack(version, bytes([0, code, 0])) == "bad user name or password"
    assert wire.connack(version, b"\0\0\0") == ""


@pytest.mark.parametrize("body", [b"\0", b"\0\5ab", b"\0\1a\0", b"\0\1a\0\7\x05", b"\0\1a\0\7\x80"])
def test_a_message_that_says_more_than_its_packet_holds_is_malformed_whatever_follows(body):
    stream = packet(0x32, body) + incoming(V5, "a/b", b"next", 7) * 3
    with pytest.raises(ProtocolError, match="malformed"):
        list(Packets(V5, 4096).feed(stream))
