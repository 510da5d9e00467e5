"""Processes of MAIN_FAST that are forked from one (`acqd.plc.nursery`), as the daemon sees them."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
import socket
from typing import Any

from acqd.plc.fast_process import StartError, environment, interpreter
from acqd.plc.nursery import MOST_BYTES

_KILLED = -signal.SIGKILL
_PATIENCE_S = 10.0  # for a fork
_STARTING_S = 60.0  # for an interpreter that starts on a busy machine
_CODE_S = 1.0


class ForkedProcess:
    """A child of the nursery, with as much of asyncio's Process as FastProcess needs."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self.stdout: asyncio.StreamReader | None = None
        self.returncode: int | None = None
        self._ended = asyncio.Event()
        self._watch()

    async def wait(self) -> int:
        """Its exit code, as the nursery has said."""
        await self._ended.wait()
        assert self.returncode is not None
        return self.returncode

    def terminate(self) -> None:
        """SIGTERM."""
        self._signal(signal.SIGTERM)

    def kill(self) -> None:
        """SIGKILL."""
        self._signal(signal.SIGKILL)

    def end(self, code: int) -> None:
        """It has ended."""
        if self.returncode is None:
            self.returncode = code
            self._ended.set()

    def _watch(self) -> None:
        """Notice the end also where the nursery, which knows the exit code, says nothing."""
        loop = asyncio.get_running_loop()
        try:
            descriptor = os.pidfd_open(self.pid)
        except OSError:  # it has ended already
            loop.call_later(_CODE_S, self.end, _KILLED)
            return

        def gone() -> None:
            loop.remove_reader(descriptor)
            os.close(descriptor)
            loop.call_later(_CODE_S, self.end, _KILLED)

        loop.add_reader(descriptor, gone)

    def _signal(self, number: signal.Signals) -> None:
        if self.returncode is not None:
            raise ProcessLookupError
        os.kill(self.pid, number)


class Nursery:
    """Starts the forking process when the first box needs it, and again when it was killed or hangs."""

    def __init__(self) -> None:
        self._line: socket.socket | None = None
        self._process: asyncio.subprocess.Process | None = None
        self._children: dict[int, ForkedProcess] = {}
        self._tickets: dict[int, asyncio.Future[ForkedProcess]] = {}
        self._next = 0
        self._starting = asyncio.Lock()
        self._answered = False

    async def spawn(self, orders: dict[str, Any], ring_fd: int, wake_fd: int) -> ForkedProcess:
        """A process of MAIN_FAST. Raises StartError when the nursery dies or hangs meanwhile."""
        async with self._starting:
            if self._line is None:
                await self._start()
        read, write = os.pipe()
        stdout = asyncio.StreamReader()
        end = open(read, "rb", buffering=0)  # noqa: SIM115 - the transport closes it
        await asyncio.get_running_loop().connect_read_pipe(lambda: asyncio.StreamReaderProtocol(stdout), end)
        child = await self._fork(orders, [ring_fd, wake_fd, write], write)
        child.stdout = stdout
        return child

    async def close(self) -> None:
        """End the forking process; its children have ended before."""
        self._lose("it was closed")
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                self._process.kill()
            await self._process.wait()

    async def _fork(self, orders: dict[str, Any], descriptors: list[int], answer: int) -> ForkedProcess:
        self._next += 1
        began: asyncio.Future[ForkedProcess] = asyncio.get_running_loop().create_future()
        self._tickets[self._next] = began
        message = json.dumps({"ticket": self._next, "orders": orders}).encode()
        try:
            if self._line is None:
                raise StartError("its nursery is gone")
            socket.send_fds(self._line, [message], descriptors)
            return await asyncio.wait_for(began, _PATIENCE_S if self._answered else _STARTING_S)
        except (OSError, TimeoutError):
            self._lose("its nursery was killed, which did not answer")
            raise StartError("its nursery does not answer") from None
        finally:
            os.close(answer)

    async def _start(self) -> None:
        ours, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        ours.setblocking(False)
        with its:
            self._process = await asyncio.create_subprocess_exec(
                *interpreter("acqd.plc.nursery", str(its.fileno())),
                stdin=asyncio.subprocess.DEVNULL,
                pass_fds=(its.fileno(),),
                env=environment(),
            )
        self._line, self._answered = ours, False
        asyncio.get_running_loop().add_reader(ours, self._hear)

    def _hear(self) -> None:
        """What the nursery says; nothing any more: it has died, and its children with it."""
        assert self._line is not None
        try:
            data = self._line.recv(MOST_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._lose("its nursery was killed")
            return
        said, self._answered = json.loads(data), True
        if "began" in said:
            child = self._children[said["began"]] = ForkedProcess(said["began"])
            ticket = self._tickets.pop(said["ticket"], None)
            if ticket is not None and not ticket.done():
                ticket.set_result(child)
            else:  # nobody waits for it any more
                child.kill()
        elif ended := self._children.pop(said["ended"], None):
            ended.end(said["code"])

    def _lose(self, why: str) -> None:
        """The forking process is of no use any more, and its children end with it."""
        if self._line is not None:
            asyncio.get_running_loop().remove_reader(self._line)
            self._line.close()
            self._line = None
        if self._process is not None and self._process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                self._process.kill()
        for ticket in self._tickets.values():
            if not ticket.done():
                ticket.set_exception(StartError(why))
        self._tickets.clear()
        for child in self._children.values():
            with contextlib.suppress(ProcessLookupError):
                child.kill()
            child.end(_KILLED)
        self._children.clear()
