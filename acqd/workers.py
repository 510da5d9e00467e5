"""Runs independent tasks in several processes of this machine, or on a Ray cluster."""

from __future__ import annotations

import multiprocessing
import os
import secrets
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, TypeVar

from acqd.errors import OperationError, UserError
from acqd.extras import install_command
from acqd.plc.realtime import die_with_parent

Task = TypeVar("Task")


_TICK_S = 0.5
_ATTEMPTS = 3
"""Starts of Ray before giving up."""


def run_here(work: Callable[[Task], Any], tasks: list[Task], jobs: int, tick: Callable[[], None]) -> Iterator[Any]:
    """Yield results in the order of completion and call `tick` twice a second; the first failure ends the run.

    Raises OperationError when a worker process was killed.
    """
    with _pool(min(jobs, len(tasks))) as pool, _ended(pool):
        with _without_interrupts():
            waiting: set[Future[Any]] = {pool.submit(work, task) for task in tasks}
        while waiting:
            done, _ = wait(waiting, _TICK_S, FIRST_COMPLETED)
            waiting -= done
            tick()
            for future in done:
                yield future.result()


def run_here_as_well(work: Callable[[Task], Any], tasks: list[Task], jobs: int) -> Iterator[Any]:
    """As `run_here`, but one of the `jobs` (two or more) is this process: for tasks that take about as long as a
    process takes to start.
    """
    with _pool(min(jobs, len(tasks)) - 1) as pool, _ended(pool):
        with _without_interrupts():
            waiting: dict[Future[Any], Task] = {pool.submit(work, task): task for task in tasks}
        while waiting:
            free = next((future for future in waiting if future.cancel()), None)
            if free is not None:
                yield work(waiting.pop(free))
            done, _ = wait(waiting, None if free is None else 0.0, FIRST_COMPLETED)
            for future in done:
                del waiting[future]
                yield future.result()


def _pool(processes: int) -> ProcessPoolExecutor:
    context = multiprocessing.get_context("spawn")  # no threads, locks or database handles inherited
    return ProcessPoolExecutor(processes, context, initializer=_begin)


def _begin() -> None:
    """First of a worker: it ends with its parent and, without a word, by the Ctrl-C that the parent answers."""
    die_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Processes that are started here keep a Ctrl-C for later: one that imports would print a traceback."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _ended(pool: ProcessPoolExecutor) -> Iterator[None]:
    """What waits at the end is left out. Raises OperationError where a worker process was killed."""
    try:
        yield
    except BrokenProcessPool:
        raise OperationError(
            "a worker process was killed (out of memory?); run the same command again to continue"
        ) from None
    finally:
        pool.shutdown(cancel_futures=True)  # by the pool's thread, which must not meet futures that others cancel


def run_in_turn(work: Callable[[Task], Any], tasks: list[Task], tick: Callable[[], None]) -> Iterator[Any]:
    """Yield results one after the other in this process: for callers whose `__main__` no worker may import again."""
    for task in tasks:
        yield work(task)
        tick()


def _start_ray(ray: Any, address: str | None) -> None:
    """Connect to a cluster, or start one: a busy machine may need more than the half minute that Ray waits for a node.

    Raises UserError where there is no cluster, OperationError where none can be started.
    """
    for attempt in range(_ATTEMPTS):
        try:
            ray.init(address=address or "local", log_to_driver=False, include_dashboard=False, configure_logging=False)
        except ConnectionError as error:
            raise UserError(f"no Ray cluster at {address}: {str(error).splitlines()[0]}") from None
        except Exception as error:  # Ray has no class of its own for a node that does not start
            ray.shutdown()
            if attempt + 1 == _ATTEMPTS:
                raise OperationError(f"Ray does not start: {str(error).splitlines()[0]}") from None
        else:
            return


def run_on_ray(
    work: Callable[[Task], Any], tasks: list[Task], address: str | None, tick: Callable[[], None]
) -> Iterator[Any]:
    """Like `run_here`, on the Ray cluster at `address`; None: on one that is started for this run.

    The workers need acqd and the folders of the tasks (a shared file system). Raises UserError, OperationError.
    """
    try:
        import ray
    except ModuleNotFoundError:
        raise UserError(f"--engine ray needs Ray: {install_command('ray')}") from None
    if address is None:  # a cluster for this run only: its processes share a secret token
        os.environ.setdefault("RAY_AUTH_TOKEN", secrets.token_hex(32))
    _start_ray(ray, address)
    try:

        def call(task: Task) -> Any:  # ray.remote takes functions only, no partial objects
            return work(task)

        remote = ray.remote(num_cpus=1, max_retries=2)(call)
        waiting = [remote.remote(task) for task in tasks]
        while waiting:
            done, waiting = ray.wait(waiting, num_returns=1, timeout=_TICK_S)
            tick()
            for reference in done:
                try:
                    yield ray.get(reference)
                except ray.exceptions.RayTaskError as error:
                    if isinstance(error.cause, UserError | OperationError):
                        raise error.cause from None
                    raise
    finally:
        ray.shutdown()
