"""Jobs in processes of their own, whose progress is told in this one."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from queue import Empty
from typing import Any

#: Called with a stage's name, what is done of it, and all of it.
StageProgress = Callable[[str, int, int], None]


def run_in_processes(
    job: Callable[..., None], arguments: list[tuple[Any, ...]], workers: int, tell: StageProgress
) -> None:
    """Run a job once for each set of arguments, in as many processes as there are workers, and pass on its progress."""
    if workers == 1:
        for given in arguments:
            job(tell, *given)
        return
    context = multiprocessing.get_context("spawn")
    with context.Manager() as manager, ProcessPoolExecutor(workers, mp_context=context) as pool:
        queue = manager.Queue()
        futures = [pool.submit(_tell_queue, job, queue, given) for given in arguments]
        while not (all(future.done() for future in futures) and queue.empty()):
            try:
                tell(*queue.get(timeout=0.2))
            except Empty:
                continue
        for future in futures:
            future.result()


def _tell_queue(job: Callable[..., None], queue: Any, arguments: tuple[Any, ...]) -> None:
    job(lambda stage, done, total: queue.put((stage, done, total)), *arguments)
