"""SDO server in the CoE mailbox (ETG.1000.6, 5.6).

Upload is expedited, normal or segmented; download is expedited or normal.
"""

from __future__ import annotations

from struct import Struct
from typing import Final

from .dictionary import UNKNOWN_COMMAND, WRONG_LENGTH, WRONG_TOGGLE, Dictionary, SdoAbort
from .registers import U16, U32

HEADER: Final = Struct("<HHBB")
SDO: Final = Struct("<BHB")
COE: Final = 3
SDO_REQUEST, SDO_RESPONSE, SDO_INFORMATION = 2, 3, 8
UNSUPPORTED_PROTOCOL, UNSUPPORTED_SERVICE = 0x0002, 0x0004
COMPLETE: Final = 0x10
TOGGLE: Final = 0x10


class SdoServer:
    """Answers mailbox messages of `size` bytes from a dictionary."""

    def __init__(self, dictionary: Dictionary, size: int) -> None:
        self.dictionary = dictionary
        self._size = size
        self._counter = 0
        self._rest = b""
        self._toggle = 0

    def answer(self, mail: bytes) -> bytes | None:
        """The answer to one message, both with their mailbox headers."""
        length, _, _, kind = HEADER.unpack_from(mail)
        body = mail[HEADER.size : HEADER.size + length]
        if kind & 0x0F != COE:
            return self._wrap(0, U16.pack(1) + U16.pack(UNSUPPORTED_PROTOCOL)) if kind & 0x0F else None
        service = U16.unpack_from(body)[0] >> 12
        if service == SDO_REQUEST and len(body) >= 6:
            return self._sdo(body[2:].ljust(8, b"\0"))
        if service == SDO_INFORMATION:
            error = bytes((7, 0, 0, 0)) + U32.pack(UNKNOWN_COMMAND)
            return self._wrap(COE, U16.pack(SDO_INFORMATION << 12) + error)
        return self._wrap(0, U16.pack(1) + U16.pack(UNSUPPORTED_SERVICE))

    def _wrap(self, kind: int, body: bytes) -> bytes:
        self._counter = self._counter % 7 + 1
        return HEADER.pack(len(body), 0, 0, kind | self._counter << 4) + body

    def _sdo(self, request: bytes) -> bytes:
        command, index, subindex = SDO.unpack_from(request)
        try:
            reply = self._dispatch(command, index, subindex, request)
            service = SDO_RESPONSE
        except SdoAbort as abort:
            reply = SDO.pack(0x80, index, subindex) + U32.pack(abort.code)
            service = SDO_REQUEST
        return self._wrap(COE, U16.pack(service << 12) + reply)

    def _dispatch(self, command: int, index: int, subindex: int, request: bytes) -> bytes:
        specifier = command >> 5
        if specifier == 2:
            return self._upload(command, index, subindex)
        if specifier == 3:
            return self._segment(command)
        if specifier == 1:
            return self._download(command, index, subindex, request)
        raise SdoAbort(UNKNOWN_COMMAND)

    def _upload(self, command: int, index: int, subindex: int) -> bytes:
        complete = command & COMPLETE
        data = self.dictionary.read_all(index, subindex) if complete else self.dictionary.read(index, subindex)
        if 0 < len(data) <= 4:
            head = SDO.pack(0x43 | complete | (4 - len(data)) << 2, index, subindex)
            return head + data.ljust(4, b"\0")
        room = self._size - HEADER.size - 2 - SDO.size - 4
        self._rest, self._toggle = data[room:], 0
        return SDO.pack(0x41 | complete, index, subindex) + U32.pack(len(data)) + data[:room]

    def _segment(self, command: int) -> bytes:
        if command & TOGGLE != self._toggle or not self._rest:
            raise SdoAbort(WRONG_TOGGLE)
        room = self._size - HEADER.size - 2 - 1
        data, self._rest = self._rest[:room], self._rest[room:]
        head = self._toggle | (0 if self._rest else 1) | max(0, 7 - len(data)) << 1
        self._toggle ^= TOGGLE
        return bytes((head,)) + data.ljust(7, b"\0")

    def _download(self, command: int, index: int, subindex: int, request: bytes) -> bytes:
        data = self._downloaded(command, request)
        if command & COMPLETE:
            self.dictionary.write_all(index, data)
        else:
            self.dictionary.write(index, subindex, data)
        return SDO.pack(0x60 | command & COMPLETE, index, subindex) + bytes(4)

    def _downloaded(self, command: int, request: bytes) -> bytes:
        """Data of an expedited or normal download; what needs segments is longer than any object here."""
        if command & 0x02:
            return request[4 : 8 - (command >> 2 & 0x03 if command & 0x01 else 0)]
        size = U32.unpack_from(request, 4)[0]
        if len(request) < 8 + size:
            raise SdoAbort(WRONG_LENGTH)
        return request[8 : 8 + size]
