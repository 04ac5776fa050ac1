"""Keep torch to a number of threads for a while."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ..terrain import missing_extra


@contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Run a block with torch on ``count`` threads, then give it back those it had.

    Networks of a few thousand weights lose more to spreading over cores than they gain, and bits are promised with
    one thread only.

    Raises
    ------
    ConfigurationError
        If torch is not installed.
    """
    try:
        import torch
    except ImportError as error:
        raise missing_extra("torch", "torch") from error
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
