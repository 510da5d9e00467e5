"""Modbus RTU server on a pseudo terminal, optionally as slow as a serial line (Modbus over Serial Line V1.02)."""

from __future__ import annotations

import contextlib
import os
import select
import tempfile
import threading
import time
import tty
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType

from tests.doubles.modbus.bank import RegisterBank
from tests.doubles.modbus.base import ModbusDouble
from tests.doubles.modbus.wire import WRITE_MANY, crc16

BITS_PER_CHARACTER = 11
_SHORTEST = 4
_LONGEST = 256
_LENGTH_OF_REQUEST = dict.fromkeys(range(1, 7), 8)
_GAP_S = 0.02
"""Silence after which an incomplete frame is dropped. A pty has no exact time, so it is longer than 3.5 characters."""
_CHUNK = 8
"""Characters handed over at once while the line is throttled: an adapter's buffer does so too."""


def silence_s(baudrate: int) -> float:
    """3.5 characters between frames; 1.75 ms above 19200 Bd (section 2.5.1.1)."""
    return 3.5 * BITS_PER_CHARACTER / baudrate if baudrate <= 19200 else 0.00175


def expected_length(start: bytes) -> int | None:
    """Characters of the request that begins so; None: not known yet, or a function without a known length."""
    if len(start) < 2:
        return None
    if start[1] in (15, WRITE_MANY):
        return 9 + start[6] if len(start) > 6 else None
    return _LENGTH_OF_REQUEST.get(start[1])


class ModbusRtuDouble(ModbusDouble):
    """Modbus RTU slaves in a thread: `with ModbusRtuDouble({1: bank}, baudrate=19200) as double: double.path`.

    With `baudrate` None the line has no speed; otherwise request, 3.5 characters of silence and answer take the time
    that they need at this rate with 11 bits a character. A unit that is not there answers nothing.
    """

    def __init__(self, units: Mapping[int, RegisterBank], baudrate: int | None = None) -> None:
        super().__init__(units)
        self.baudrate = baudrate
        self._folder = tempfile.TemporaryDirectory(prefix="modbus-rtu-")
        self.path = str(Path(self._folder.name) / "tty")
        """A link to the slave side of the pty; it stays the same when the line is unplugged and plugged in again."""
        self._master = self._slave = -1
        self._unplug_s = 0.0
        self._wake_read, self._wake_write = os.pipe()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="modbus rtu double", daemon=True)

    def __enter__(self) -> ModbusRtuDouble:
        self._plug()
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._stopping.set()
        os.write(self._wake_write, b"x")
        self._thread.join()
        self._close_line()
        os.close(self._wake_read)
        os.close(self._wake_write)
        self._folder.cleanup()

    def refuse(self, seconds: float) -> None:
        """Unplug the adapter for `seconds` from now: an open port fails, and the path does not exist."""
        self._unplug_s = seconds
        os.write(self._wake_write, b"x")

    def _plug(self) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        Path(self.path).symlink_to(os.ttyname(self._slave))

    def _close_line(self) -> None:
        Path(self.path).unlink(missing_ok=True)
        os.close(self._slave)
        os.close(self._master)

    def _serve(self) -> None:
        buffer, began = b"", 0.0
        while not self._stopping.is_set():
            ready, _, _ = select.select([self._master, self._wake_read], [], [], _GAP_S if buffer else None)
            if self._wake_read in ready:
                os.read(self._wake_read, 64)
                self._replug()
                buffer = b""
            elif ready:
                began = began if buffer else time.monotonic()
                buffer = self._take_frames(buffer + os.read(self._master, 4096), began)
            else:
                self._end_of_frame(buffer, began)
                buffer = b""

    def _replug(self) -> None:
        if self._unplug_s:
            self._close_line()
            while self._unplug_s and not self._stopping.is_set():  # another `refuse` begins another pause
                pause_s, self._unplug_s = self._unplug_s, 0.0
                if select.select([self._wake_read], [], [], pause_s)[0]:
                    os.read(self._wake_read, 64)
            self._plug()

    def _take_frames(self, buffer: bytes, began: float) -> bytes:
        """Handle each whole request; a wrong CRC drops all, as a slave waits for silence then."""
        while (length := expected_length(buffer)) is not None and len(buffer) >= length:
            if buffer[length - 2 : length] != crc16(buffer[: length - 2]):
                return b""
            self._handle(buffer[:length], began)
            buffer, began = buffer[length:], time.monotonic()
        return buffer

    def _end_of_frame(self, buffer: bytes, began: float) -> None:
        """After silence: a frame of a function without a known length is one if its CRC is right."""
        if _SHORTEST <= len(buffer) <= _LONGEST and buffer[-2:] == crc16(buffer[:-2]):
            self._handle(buffer, began)

    def _handle(self, frame: bytes, began: float) -> None:
        unit, pdu = frame[0], frame[1:-2]
        self._note(unit, pdu)
        if unit == 0:
            self._broadcast(pdu)
        elif (reply := self._respond(unit, pdu)) is not None:
            self._wait_until(began + self._line_s(len(frame)) + self._silence_s() + self.latency_s)
            self._send(self._frame(unit, reply))

    def _broadcast(self, pdu: bytes) -> None:
        for unit in self.units:
            self._respond(unit, pdu)

    def _frame(self, unit: int, reply: bytes) -> bytes:
        reply, damage = self._damaged(unit, reply)
        body = bytes((unit,)) + reply
        check = crc16(body)
        if damage == "garbage":
            check = bytes((check[0] ^ 0xFF, check[1]))
        frame = body + check
        return frame[: len(frame) // 2] if damage == "cut" else frame

    def _line_s(self, characters: int) -> float:
        return characters * BITS_PER_CHARACTER / self.baudrate if self.baudrate else 0.0

    def _silence_s(self) -> float:
        return silence_s(self.baudrate) if self.baudrate else 0.0

    def _wait_until(self, instant: float) -> None:
        if (rest := instant - time.monotonic()) > 0:
            time.sleep(rest)

    def _send(self, frame: bytes) -> None:
        """Each chunk is handed over when its last character would have arrived."""
        step = _CHUNK if self.baudrate else len(frame)
        began = time.monotonic()
        for at in range(0, len(frame), step):
            chunk = frame[at : at + step]
            self._wait_until(began + self._line_s(at + len(chunk)))
            with contextlib.suppress(OSError):  # nobody reads: a serial line does not notice either
                os.write(self._master, chunk)
