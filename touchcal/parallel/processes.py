"""Worker processes of this machine: one thread each, replaced where they die, and gone when their parent is.

A process has one pipe of its own and works on one item at a time, so that a death is noticed at once, even in the
middle of an answer, and costs no other item. (The pool of concurrent.futures shares its pipes: there one death breaks
all that is under way, and one in the middle of an answer can leave the parent waiting.)
"""

import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import connection, resource_tracker
from multiprocessing.process import BaseProcess
from typing import Any

from touchcal.parallel.pool import InProcess, PoolUnavailable, Submit, Task, WorkerLost, WorkerPool

THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


@contextmanager
def processes(count: int) -> Iterator[WorkerPool]:
    """`count` worker processes, started as they are needed; for one, this process."""
    if count == 1:
        yield InProcess()
        return
    pool = _Processes(count)
    try:
        yield pool
    finally:
        pool.dismiss()


@dataclass
class _Worker:
    process: BaseProcess
    pipe: connection.Connection
    task: bytes | None = None  # the task that it was given last, pickled


class _Processes:
    """A thread of the parent for each worker hands it items and waits for its answers."""

    losses = (WorkerLost,)

    def __init__(self, count: int) -> None:
        self._count = count
        self._threads = ThreadPoolExecutor(count)
        self._own = threading.local()
        self._starting = threading.Lock()
        self._hired: list[_Worker] = []
        self._dismissed = False

    def max_in_flight(self) -> int:
        """Two for every worker, so that none waits while the parent writes; the second is not with it yet."""
        return 2 * self._count

    def broadcast(self, task: Task) -> Submit:
        pickled = pickle.dumps(task)

        def submit(item: Any) -> Future[Any]:
            return self._threads.submit(self._asked, pickled, item)
        return submit

    def look(self) -> None:
        """The end of a process is noticed at once."""

    def dismiss(self) -> None:
        """End the workers, whatever they are at."""
        with self._starting:
            self._dismissed = True
            for worker in self._hired:
                worker.process.kill()
        self._threads.shutdown(cancel_futures=True)
        for worker in self._hired:
            worker.process.join()

    def _asked(self, task: bytes, item: Any) -> Any:
        worker = getattr(self._own, "worker", None)
        if worker is None:
            worker = self._own.worker = self._started()
        try:
            worker.pipe.send((None if worker.task is task else task, item))
            worker.task = task
            answer, error = worker.pipe.recv()
        except (EOFError, OSError):
            self._own.worker = None
            raise WorkerLost(f"its process {_end(worker)}") from None
        if error is not None:
            raise error
        return answer

    def _started(self) -> _Worker:
        with self._starting:
            if self._dismissed:
                raise WorkerLost("its process was not started any more")
            worker = _spawned()
            self._hired.append(worker)
        try:
            worker.pipe.recv()
        except (EOFError, OSError):
            how = _end(worker)
            if (worker.process.exitcode or 0) > 0:
                raise PoolUnavailable(
                    f"a worker process {how} as it started, with what it wrote above. A script that calls "
                    "this needs `if __name__ == \"__main__\":` around it.") from None
            raise WorkerLost(f"its process {how} as it started") from None
        return worker


def _leave_interrupts() -> None:
    """Ctrl-C is the parent's alone: processes started from this thread do not get it. The tracker of multiprocessing
    unblocks it as it starts, so that comes first."""
    resource_tracker.ensure_running()
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})


def _spawned() -> _Worker:
    """A new process and its pipe, whose other end no one but that process holds."""
    _leave_interrupts()
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(theirs,), daemon=True)
    before = {name: os.environ.get(name) for name in THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    try:
        process.start()
    finally:
        theirs.close()
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
    return _Worker(process, ours)


def _end(worker: _Worker) -> str:
    worker.process.join()
    worker.pipe.close()
    code = worker.process.exitcode
    return f"was killed by signal {-code}" if code is not None and code < 0 else f"ended with status {code}"


def _work(pipe: connection.Connection) -> None:
    """Answer items until the parent's end of the pipe closes."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        pipe.send(None)
        task: Task | None = None
        while True:
            pickled, item = pipe.recv()
            if pickled is not None:
                task = pickle.loads(pickled)
            assert task is not None
            pipe.send(_answered(task, item))


def _answered(task: Task, item: Any) -> tuple[Any, Exception | None]:
    try:
        return task(item), None
    except Exception as error:
        return None, _sendable(error)


def _sendable(error: Exception) -> Exception:
    """The error itself, or its words where it does not survive the way to the parent."""
    try:
        return pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")


def _end_with_parent() -> None:
    """End in the middle of a task too when the parent is gone."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    connection.wait([parent.sentinel])
    os._exit(1)
