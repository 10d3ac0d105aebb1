"""How many threads torch and the libraries of linear algebra work on, for a while."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import pairwise
from threading import Lock

import torch
from threadpoolctl import threadpool_limits


@contextmanager
def threads(count: int | None) -> Iterator[None]:
    """Within the block, torch and the libraries of linear algebra work on `count` threads; None changes nothing."""
    if count is None:
        yield
        return
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        with threadpool_limits(count):
            yield
    finally:
        torch.set_num_threads(before)


_lock, _inside, _before = Lock(), 0, 1


def in_threads(work: Callable[[int, int], None], items: int, count: int) -> None:
    """Call `work(begin, end)` for as many parts of `items` as there are threads, at the same time."""
    if count == 1:
        return work(0, items)
    edges = [items * part // count for part in range(count + 1)]
    with ThreadPoolExecutor(count) as pool:
        list(pool.map(lambda part: work(*part), pairwise(edges)))
    return None


@contextmanager
def one_torch_thread() -> Iterator[None]:
    """Within the block, torch works on one thread: waiting threads of torch would keep the cores busy that the renderer needs.

    torch has one count for the whole process, so blocks of several threads of Python share it: the last one to end restores it.
    """
    global _inside, _before
    with _lock:
        if _inside == 0:
            _before = torch.get_num_threads()
            torch.set_num_threads(1)
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if _inside == 0:
                torch.set_num_threads(_before)
