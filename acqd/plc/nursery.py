"""The process that forks the processes of MAIN_FAST of several boxes: `python -m acqd.plc.nursery FD`.

The processes share the pages of interpreter and numpy as long as nobody writes to them, which saves most of what a box
takes of memory. It does nothing else, and has no threads, so that a fork is a whole copy. When it is killed, the kernel
ends its children.
"""

from __future__ import annotations

import contextlib
import gc
import json
import os
import select
import signal
import socket
import sys
import traceback

from acqd.plc.process import run
from acqd.plc.realtime import die_with_parent

MOST_BYTES = 1 << 16
"""Orders of a box in one message at most."""


def main() -> int:
    """Fork for each message with orders and three descriptors (ring, wake-up, answer), until the socket is closed."""
    die_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    line = socket.socket(fileno=int(sys.argv[1]))
    gc.collect()
    gc.freeze()  # a collection would write to every page
    poll = select.poll()
    poll.register(line, select.POLLIN)
    children: dict[int, int] = {}  # pid by pidfd
    while True:
        for descriptor, _ in poll.poll():
            if descriptor != line.fileno():
                poll.unregister(descriptor)
                _bury(line, descriptor, children.pop(descriptor))
                continue
            data, descriptors, _, _ = socket.recv_fds(line, MOST_BYTES, 3)
            if not data:
                return 0
            said, parent = json.loads(data), os.getpid()
            pid = os.fork()
            if not pid:
                line.close()
                for other in children:
                    os.close(other)
                die_with_parent()
                if os.getppid() != parent:
                    os._exit(1)
                _live(said["orders"], *descriptors)
            for each in descriptors:
                os.close(each)
            child = os.pidfd_open(pid)
            children[child] = pid
            poll.register(child, select.POLLIN)
            line.send(json.dumps({"began": pid, "ticket": said["ticket"]}).encode())


def _bury(line: socket.socket, descriptor: int, pid: int) -> None:
    """Say how a child ended."""
    os.close(descriptor)
    _, status = os.waitpid(pid, 0)
    line.send(json.dumps({"ended": pid, "code": os.waitstatus_to_exitcode(status)}).encode())


def _live(orders: dict[str, object], ring: int, wake: int, answer: int) -> None:
    """The life of a child, which does not return."""
    code = 1
    try:
        os.dup2(answer, 1)
        os.close(answer)
        code = run(orders | {"ring_fd": ring, "wake_fd": wake})
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(Exception):
            sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    sys.exit(main())
