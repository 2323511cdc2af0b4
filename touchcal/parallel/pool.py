"""Handing tasks to whoever works on them, a few at a time, and again where a worker was lost."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

from touchcal.parallel.one_thread import ONE_THREAD

Task = Callable[[Any], Any]
Submit = Callable[[Any], Future[Any]]  # hands one item to the task that the pool was given

_LOOK_S = 5.0  # How often a pool that does not answer is looked after, s.


class WorkerLost(Exception):
    """The process that worked on an item ended before it answered."""


class PoolUnavailable(OSError):
    """Nobody is there, or any longer there, to work; the message says why and what to do."""


class WorkerPool(Protocol):
    """Who works: this process, processes of this machine, an executor, or a cluster."""

    @property
    def losses(self) -> tuple[type[BaseException], ...]:
        """What a future raises whose worker was lost."""
        ...

    def max_in_flight(self) -> int:
        """Items that are handed out at a time: all that work at once, and those that wait for them."""
        ...

    def broadcast(self, task: Task) -> Submit:
        """Send a task with all that it holds to every worker, once; items follow one by one."""
        ...

    def look(self) -> None:
        """Asked now and then while no answer comes; PoolUnavailable where none will."""
        ...


@dataclass(frozen=True)
class Failed:
    """In place of an answer."""

    error: BaseException  # what the task raised, or what the loss of its last worker raised
    lost: bool  # whether it is a loss, so that the item may succeed elsewhere

    @property
    def reason(self) -> str:
        """In words, what became of it."""
        return str(self.error) if self.lost else f"{type(self.error).__name__}: {self.error}"


def answers(pool: WorkerPool, task: Task, items: Iterable[Any], tries: int = 2) -> Iterator[tuple[Any, Any]]:
    """Yield (item, task(item)) as they come, or (item, Failed) where the task raises or `tries` workers were lost on
    it. Items are taken from their iterable as workers become free. PoolUnavailable where there is nobody to work. This
    process has one thread of linear algebra meanwhile, as its workers have."""
    with ONE_THREAD:
        yield from _answers(pool, task, items, tries)


def _answers(pool: WorkerPool, task: Task, items: Iterable[Any], tries: int) -> Iterator[tuple[Any, Any]]:
    submit = pool.broadcast(partial(_on_one_thread, task))
    ahead, again = iter(items), deque[tuple[Any, int]]()
    out: dict[Future[Any], tuple[Any, int]] = {}
    while True:
        while len(out) < pool.max_in_flight() and (taken := again.popleft() if again else _next(ahead)):
            out[submit(taken[0])] = taken
        if not out:
            return
        while not (done := wait(out, timeout=_LOOK_S, return_when=FIRST_COMPLETED).done):
            pool.look()
        for future in done:
            item, lost = out.pop(future)
            found = _outcome(future, pool.losses)
            if isinstance(found, Failed) and found.lost and lost + 1 < tries:
                again.append((item, lost + 1))
            else:
                yield item, found


def _next(items: Iterator[Any]) -> tuple[Any, int] | None:
    for item in items:
        return item, 0
    return None


def _outcome(future: Future[Any], losses: tuple[type[BaseException], ...]) -> Any:
    try:
        return future.result()
    except PoolUnavailable:
        raise
    except losses as error:
        return Failed(error, lost=True)
    except Exception as error:
        return Failed(error, lost=False)


def _on_one_thread(task: Task, item: Any) -> Any:
    """Threads of linear algebra would take each other's cores, and their number changes the last digits of sums."""
    with ONE_THREAD:
        return task(item)


@dataclass(frozen=True)
class InProcess:
    """This process."""

    losses: tuple[type[BaseException], ...] = ()

    def max_in_flight(self) -> int:
        """One: the next item is taken when this one is done."""
        return 1

    def broadcast(self, task: Task) -> Submit:
        """Items are worked on as they are handed over."""
        def submit(item: Any) -> Future[Any]:
            done: Future[Any] = Future()
            try:
                done.set_result(task(item))
            except Exception as error:
                done.set_exception(error)
            return done
        return submit

    def look(self) -> None:
        """It has answered when it is asked."""


@dataclass(frozen=True)
class ExecutorPool:
    """Any executor of the interface of concurrent.futures; the task travels with every item."""

    executor: Executor
    count: int  # items handed out at a time, for instance twice its workers
    losses: tuple[type[BaseException], ...] = ()

    def max_in_flight(self) -> int:
        """As many as its owner says."""
        return self.count

    def broadcast(self, task: Task) -> Submit:
        """Items go to the executor; PoolUnavailable where it is broken, since only its owner can start another."""
        def submit(item: Any) -> Future[Any]:
            try:
                return self.executor.submit(task, item)
            except (BrokenExecutor, RuntimeError) as error:
                raise PoolUnavailable(f"the executor takes no more work: {error}. Start another and call "
                                      "again.") from None
        return submit

    def look(self) -> None:
        """Its owner knows whether it is at work."""
