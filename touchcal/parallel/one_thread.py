"""One thread of linear algebra: several are slower than one on small matrices, and their number changes last digits."""

import threading
from contextlib import ContextDecorator

from threadpoolctl import threadpool_limits


class _OneThread(ContextDecorator):
    """The limit is the process's own, and the thread that sets it keeps others from changing it: the first of several
    that ask for it at a time sets it, the last one lifts it."""

    def __init__(self) -> None:
        self._lock, self._users = threading.Lock(), 0
        self._limit: threadpool_limits | None = None

    def __enter__(self) -> None:
        with self._lock:
            if not self._users:
                self._limit = threadpool_limits(1)
            self._users += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._users -= 1
            if not self._users and self._limit is not None:
                self._limit.restore_original_limits()


ONE_THREAD = _OneThread()
