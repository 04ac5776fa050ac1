"""Who runs many jobs at once: joblib on this machine, or a Ray cluster behind the same joblib."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from typing import Any, Final, Literal

from ...terrain import WorkerLostError, missing_extra, unknown_name

Engine = Literal["joblib", "ray"]
ENGINES: Final[tuple[Engine, ...]] = ("joblib", "ray")

# Ray's joblib backend returns a list, not a stream: jobs go in lots, so that progress is seen.
_LOT: Final = 8


def require_engine(engine: str) -> None:
    """Raise ConfigurationError if an engine is unknown or its package is missing."""
    if engine not in ENGINES:
        raise unknown_name("engine", engine, ENGINES)
    if engine == "ray":
        _ray()


def in_parallel(
    function: Callable[..., Any], jobs: Sequence[tuple[Any, ...]], workers: int, engine: Engine = "joblib"
) -> Iterator[Any]:
    """Yield ``function(*job)`` of every job, as they finish.

    Parameters
    ----------
    function : callable
        Of a module, so that workers can import it.
    jobs : sequence of tuple
        Arguments; they and the results are pickled.
    workers : int
        Processes.
    engine : {"joblib", "ray"}
        ``"ray"`` takes the cluster that this process is connected to or that RAY_ADDRESS names (``auto`` finds one
        on this machine), or starts a local one of so many workers, which ends with the jobs. Several machines need a
        file system in common.

    Raises
    ------
    ConfigurationError
        If the engine is unknown or its package is missing.
    WorkerLostError
        If a worker process was killed.
    """
    require_engine(engine)
    if engine == "ray" and jobs:
        yield from _on_ray(function, jobs, workers)
    elif workers == 1 or len(jobs) < 2:
        yield from (function(*job) for job in jobs)
    else:
        joblib = _joblib()
        parallel = joblib.Parallel(n_jobs=workers, return_as="generator_unordered")
        try:
            yield from parallel(joblib.delayed(function)(*job) for job in jobs)
        except BrokenExecutor as error:
            raise _worker_lost() from error


def _on_ray(function: Callable[..., Any], jobs: Sequence[tuple[Any, ...]], workers: int) -> Iterator[Any]:
    lots = [jobs[start : start + _LOT * workers] for start in range(0, len(jobs), _LOT * workers)]
    with _ray_pool(workers) as (pool, delayed):
        for lot in lots:
            try:
                yield from pool(delayed(function)(*job) for job in lot)
            except _ray().exceptions.RayError as error:
                raise _worker_lost() from error


@contextmanager
def _ray_pool(workers: int) -> Iterator[tuple[Any, Any]]:
    """Give a joblib pool on Ray and ``joblib.delayed``; a cluster that is started here ends here."""
    joblib, ray = _joblib(), _ray()
    from ray.util.joblib import register_ray

    started = not ray.is_initialized()
    if started:
        # A local cluster is nobody's to count, and a cluster that is named brings its own number of CPUs.
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        local = {"address": "local", "num_cpus": workers, "include_dashboard": False}
        named = bool(os.environ.get("RAY_ADDRESS"))
        ray.init(log_to_driver=False, logging_level=logging.ERROR, **({} if named else local))
    try:
        register_ray()
        with joblib.parallel_config(backend="ray", n_jobs=workers):
            pool = joblib.Parallel()
        with pool:
            yield pool, joblib.delayed
    finally:
        if started:
            ray.shutdown()


def _worker_lost() -> WorkerLostError:
    return WorkerLostError(
        "a worker process was killed, as the system does where memory runs out; finished runs are kept, and the "
        "same command goes on from there: with fewer workers if it happens again"
    )


def _joblib() -> Any:
    try:
        import joblib
    except ImportError as error:
        raise missing_extra("joblib", "torch") from error
    return joblib


def _ray() -> Any:
    try:
        import ray
    except ImportError as error:
        raise missing_extra("ray", "ray") from error
    return ray
