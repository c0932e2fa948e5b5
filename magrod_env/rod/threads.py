"""Threads that share a batch: how many there may be, and a pool that survives a fork."""

import os
from concurrent.futures import ThreadPoolExecutor
from numbers import Real


def usable_cores() -> int:
    """Cores that this process may use: those of its affinity mask, where the system has one."""
    if hasattr(os, "process_cpu_count"):  # Python 3.13
        return os.process_cpu_count() or 1
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def checked_num_threads(num_threads) -> int:
    """The number of threads; for None one for each usable core.

    Raises:
        ValueError: unless it is None or a whole number of 1 or more.
    """
    if num_threads is None:
        return usable_cores()
    number = isinstance(num_threads, Real) and not isinstance(num_threads, bool)
    if not (number and 1 <= num_threads < float("inf") and num_threads == int(num_threads)):
        raise ValueError(
            f"num_threads must be a whole number of 1 or more, but got {num_threads!r}: "
            "give a number, or None for one for each core that the process may use."
        )
    return int(num_threads)


class Pool:
    """Other threads beside the calling one, started when they are first needed.

    A forked child has the pool's object but none of its threads, and would wait for them for ever: it starts its own.
    """

    def __init__(self, num_threads: int):
        self._size, self._executor, self._process = num_threads - 1, None, None

    def submit(self, function, *arguments):
        """Start a call on another thread; returns its future."""
        if self._process != os.getpid():
            self._executor = ThreadPoolExecutor(self._size, thread_name_prefix="magrod")
            self._process = os.getpid()
        return self._executor.submit(function, *arguments)

    def __reduce__(self):
        return Pool, (self._size + 1,)
