"""Framers that find the answer to the last request among whatever else the line carries.

pymodbus takes the first bytes for a frame: a stray byte, an echo of the request or the answer to an earlier request
makes a meter silent, or gives one register the value of another. These look for what was asked: unit, function, number
of bytes and, on a serial line, the checksum, at every position.
"""

from __future__ import annotations

import logging
import time
from collections import deque
from dataclasses import dataclass, field
from typing import Any

from pymodbus.framer.ascii import FramerAscii
from pymodbus.framer.base import FramerBase
from pymodbus.framer.rtu import FramerRTU
from pymodbus.framer.socket import FramerSocket
from pymodbus.pdu import ModbusPDU

_log = logging.getLogger(__name__)
_RECENT = 16  # requests whose late answers are recognised
_EXCEPTION = 0x80
_MARGIN = 1.5
"""Times the longest delay of a second answer that has been seen: the next may take longer."""


@dataclass(slots=True)
class Line:
    """What is known of one link, whatever connection it has."""

    title: str
    echo: bool = False
    """Every request comes back before its answer."""
    exact: bool = False
    """TCP: an answer has had the transaction id and unit of its request, so one that has not is not the answer."""
    recent: deque[int] = field(default_factory=lambda: deque(maxlen=_RECENT))
    """Transaction ids of the last requests."""
    pause_s: float = 0.0
    """Serial: so long after an answer, other answers may come for which nobody has asked."""
    unsettled: bool = False
    """Serial: such an answer has come, and it is not known for how long others may follow."""
    warned: set[str] = field(default_factory=set)

    def warn(self, text: str) -> None:
        """Say something once."""
        if text not in self.warned:
            self.warned.add(text)
            _log.warning("%s: %s", self.title, text)

    def repeated(self, after_s: float | None = None) -> None:
        """An answer has come for which nobody has asked, `after_s` after the last one; None: nobody knows when."""
        self.warn("answers come twice or late; those to earlier requests are passed over: check slave and gateway")
        if after_s is not None:
            self.pause_s = max(self.pause_s, _MARGIN * after_s)
        elif not self.pause_s:
            self.unsettled = True


@dataclass(slots=True)
class _Question:
    """The request that is under way."""

    frame: bytes = b""
    function: int = 0
    size: int = 0
    """Bytes of registers that the answer must have."""

    def answered_by(self, pdu: bytes) -> bool:
        """Whether this begins as an answer: function and number of bytes, or an exception."""
        if len(pdu) < 2:
            return False
        return (pdu[0] == self.function and pdu[1] == self.size) or pdu[0] == self.function | _EXCEPTION

    def length(self, pdu: bytes) -> int:
        """Bytes of the answer to a request of this function that begins here; 0 for anything else."""
        if len(pdu) < 2 or pdu[0] & ~_EXCEPTION != self.function:
            return 0
        return 2 if pdu[0] & _EXCEPTION else 2 + pdu[1]


def _question(message: ModbusPDU, frame: bytes) -> _Question:
    return _Question(frame, message.function_code, 2 * int(getattr(message, "count", 0)))


class _Resync(FramerBase):
    """The answer is where unit, function, number of bytes and checksum are right."""

    def __init__(self, decoder: Any, line: Line) -> None:
        super().__init__(decoder)
        self._line = line
        self._question = _Question()
        self._answered_s: float | None = None
        self.heard = 0
        """How often bytes have come."""
        self.timing = False
        """Whether bytes are read as soon as they come, and not when the next request is due."""

    def buildFrame(self, message: ModbusPDU) -> bytes:  # noqa: N802
        """The request, which is remembered."""
        frame = super().buildFrame(message)
        self._question, self._answered_s = _question(message, frame), None
        return frame

    def handleFrame(self, data: bytes, exp_devid: int, exp_tid: int) -> tuple[int, ModbusPDU | None]:  # noqa: N802
        """(bytes used, answer); bytes that cannot begin an answer are kept until the next request clears them."""
        del exp_tid
        self.heard += 1
        if self._answered_s is not None:
            return self._unasked(data, exp_devid)
        question, begin = self._question, 0
        if question.frame and question.frame in data:
            begin = data.index(question.frame) + len(question.frame)
            if not self._line.echo:
                self._line.warn("its requests come back (echo of the adapter); they are passed over")
        elif self._line.echo and len(data) >= len(question.frame):
            begin = len(question.frame)
        for at in range(begin, len(data)):
            unit, pdu = self._frame(data, at)
            if (exp_devid and unit != exp_devid) or not question.answered_by(pdu):
                continue
            self._say_what_came_before(data[begin:at], unit)
            answer = self.decoder.decode(pdu)
            if answer is not None:
                self._answered_s = time.monotonic()
                answer.dev_id, answer.transaction_id = unit, 0
                return len(data), answer
        return 0, None

    def pause_left_s(self) -> float:
        """How long answers for which nobody has asked may still come."""
        return 0.0 if self._answered_s is None else self._answered_s + self._line.pause_s - time.monotonic()

    def _unasked(self, data: bytes, unit: int) -> tuple[int, None]:
        """What comes after the answer."""
        if not self._holds_an_answer(data, unit):
            return 0, None
        assert self._answered_s is not None
        self._line.repeated(time.monotonic() - self._answered_s if self.timing else None)
        return len(data), None

    def _say_what_came_before(self, data: bytes, unit: int) -> None:
        """A whole answer of the unit to another request, or stray bytes."""
        if self._holds_an_answer(data, unit):
            self._line.unsettled = True
            self._line.repeated()
        elif data:
            self._line.warn("stray bytes come before answers; check biasing and termination of the line")

    def _holds_an_answer(self, data: bytes, unit: int) -> bool:
        frames = (self._frame(data, at) for at in range(len(data)))
        return any(who == unit and pdu[:1] == bytes((self._question.function,)) for who, pdu in frames)

    def _frame(self, data: bytes, at: int) -> tuple[int, bytes]:
        """Unit, and function with data, of the answer to a request like the last one that begins at `at` and is whole;
        no bytes where none does.
        """
        raise NotImplementedError


class ResyncRtu(_Resync, FramerRTU):
    """RTU: a frame has no begin, and its CRC at the end."""

    def _frame(self, data: bytes, at: int) -> tuple[int, bytes]:
        length = self._question.length(data[at + 1 : at + 3])
        end = at + 1 + length
        if not length or end + 2 > len(data):
            return 0, b""
        if not self.check_CRC(data[at:end], int.from_bytes(data[end : end + 2], "big")):
            return 0, b""
        return data[at], data[at + 1 : end]


class ResyncAscii(_Resync, FramerAscii):
    """ASCII: a frame is `:`, two hexadecimal digits a byte, its LRC, and the end of the line."""

    def _frame(self, data: bytes, at: int) -> tuple[int, bytes]:
        end = data.find(self.end, at) if data[at : at + 1] == self.START else -1
        try:
            unit, *pdu, lrc = bytes.fromhex(data[at + 1 : max(end, 0)].decode("ascii"))
        except ValueError:  # also: fewer than two
            return 0, b""
        whole = bytes(pdu)
        if len(whole) != self._question.length(whole) or not self.check_LRC(bytes((unit, *pdu)), lrc):
            return 0, b""
        return unit, whole


class LenientSocket(FramerSocket):
    """TCP: gateways that answer with unit 0, or with a transaction id of their own, are understood."""

    def __init__(self, decoder: Any, line: Line) -> None:
        super().__init__(decoder)
        self._line = line
        self._question = _Question()

    def buildFrame(self, message: ModbusPDU) -> bytes:  # noqa: N802
        """The request, which is remembered."""
        frame = super().buildFrame(message)
        self._question = _question(message, frame)
        self._line.recent.append(message.transaction_id)
        return frame

    def handleFrame(self, data: bytes, exp_devid: int, exp_tid: int) -> tuple[int, ModbusPDU | None]:  # noqa: N802
        """(bytes used, answer)."""
        used = 0
        while len(data) - used >= self.MIN_SIZE:
            length, unit, tid, pdu = self.decode(data[used:])
            if not length:
                if int.from_bytes(data[used + 2 : used + 4], "big"):
                    used += 1  # no header of Modbus: look for one
                    continue
                break
            used += length
            if not self._question.answered_by(pdu) or not self._accepts(unit, tid, exp_devid, exp_tid):
                continue
            answer = self.decoder.decode(pdu)
            if answer is not None:
                answer.dev_id, answer.transaction_id = exp_devid, exp_tid
                return used, answer
        return used, None

    def _accepts(self, unit: int, tid: int, wanted_unit: int, wanted_tid: int) -> bool:
        """Whether a frame is the answer to the request under way; one request is under way on a connection."""
        line = self._line
        if (unit, tid) == (wanted_unit, wanted_tid):
            line.exact = True
            return True
        if line.exact or (tid != wanted_tid and tid in line.recent):
            return False
        if unit != wanted_unit:
            line.warn(f"the gateway answers with unit {unit} for unit {wanted_unit}; its answers are taken in turn")
        if tid != wanted_tid:
            line.warn("the gateway answers with transaction ids of its own; its answers are taken in turn")
        return True
