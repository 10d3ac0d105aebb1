"""How many threads the libraries below work on."""

from threading import Lock

import torch
from threadpoolctl import threadpool_limits

from tussock.world.errors import InputError


def use_threads(count: int) -> None:
    """Have torch and the libraries of linear algebra work on `count` threads from here on. Raises InputError for under 1."""
    if count < 1:
        raise InputError(f"{count} threads; give at least 1")
    torch.set_num_threads(count)
    threadpool_limits(count)


class OneTorchThread:
    """While any walk goes on, torch works on one thread: its others wait for more to do in a way that keeps the cores busy, and the
    renderer needs them. The last walk to end gives torch its threads back.
    """

    walks, threads = 0, 1
    lock = Lock()

    def __enter__(self) -> None:
        with OneTorchThread.lock:
            if OneTorchThread.walks == 0:
                OneTorchThread.threads = torch.get_num_threads()
                torch.set_num_threads(1)
            OneTorchThread.walks += 1

    def __exit__(self, kind, error, at) -> None:
        with OneTorchThread.lock:
            OneTorchThread.walks -= 1
            if OneTorchThread.walks == 0:
                torch.set_num_threads(OneTorchThread.threads)
