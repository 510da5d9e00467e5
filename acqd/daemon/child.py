"""The end of a child process of the daemon."""

from __future__ import annotations

import asyncio


async def end(process: asyncio.subprocess.Process | None, patience_s: float) -> None:
    """Terminate a process; kill it if it takes longer than `patience_s`. None, or one that has ended: nothing."""
    if process is None or process.returncode is not None:
        return
    process.terminate()
    try:
        await asyncio.wait_for(process.wait(), patience_s)
    except TimeoutError:
        process.kill()
