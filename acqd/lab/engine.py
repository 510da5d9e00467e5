"""Who does the sessions: this process, several processes, or a Ray cluster."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

from acqd.errors import OperationError, UserError

Task = TypeVar("Task")


def run_here(work: Callable[[Task], Any], tasks: list[Task], jobs: int) -> Iterator[Any]:
    """Results as they come. The first failure ends the run; what is done stays done."""
    if jobs == 1 or len(tasks) == 1:
        yield from map(work, tasks)
        return
    context = multiprocessing.get_context("spawn")  # no threads, locks or database handles inherited
    with ProcessPoolExecutor(min(jobs, len(tasks)), mp_context=context) as pool:
        waiting: set[Future[Any]] = {pool.submit(work, task) for task in tasks}
        try:
            while waiting:
                done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                for future in done:
                    yield future.result()
        except BrokenProcessPool:
            raise OperationError(
                "a worker process was killed (out of memory?); run the same command again to go on"
            ) from None
        finally:
            for future in waiting:
                future.cancel()


def run_on_ray(work: Callable[[Task], Any], tasks: list[Task], address: str | None) -> Iterator[Any]:
    """Results as they come, from a Ray cluster; without an address, from one started here for the purpose.

    The workers need acqd and the campaign's folder (a shared file system). Raises UserError.
    """
    try:
        import ray
    except ModuleNotFoundError:
        raise UserError("--engine ray needs Ray: install acqd[ray]") from None
    try:
        ray.init(address=address, log_to_driver=False, include_dashboard=False, configure_logging=False)
    except ConnectionError as error:
        raise UserError(f"no Ray cluster at {address}: {str(error).splitlines()[0]}") from None
    try:
        remote = ray.remote(num_cpus=1, max_retries=2)(work)
        waiting = [remote.remote(task) for task in tasks]
        while waiting:
            done, waiting = ray.wait(waiting, num_returns=1)
            try:
                yield ray.get(done[0])
            except ray.exceptions.RayTaskError as error:
                raise error.cause from None
    finally:
        ray.shutdown()
