"""Workers of a dask.distributed cluster, by the address of its scheduler."""

import logging
import pickle
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager
from functools import partial
from typing import Any

from touchcal.cache import key_of
from touchcal.parallel.pool import PoolUnavailable, Submit, Task, WorkerPool
from touchcal.provenance import versions

# How long a scheduler may take to answer, how often the cluster's size is asked for, how long it may be without
# workers, and how long a finished result may take to come, s: to a client that is closed meanwhile it never does.
_ANSWER_S, _SIZE_S, _WITHOUT_S, _FETCH_S = 10.0, 5.0, 300.0, 60.0
_GONE = "the dask scheduler is gone. Start one, and the same command again: what is finished is kept."


@contextmanager
def cluster(address: str) -> Iterator[WorkerPool]:
    """The workers of the scheduler at `address`, for instance tcp://10.0.0.1:8786. ValueError without dask.distributed
    or where the address is none; PoolUnavailable where no scheduler answers, or it has no workers, or any of several
    threads, or that runs other code or libraries than this process, which one that joins later tells with its first
    item."""
    try:
        from distributed import Client
    except ImportError:
        raise ValueError("--scheduler needs dask.distributed. Run pip install '.[cluster]' in the project's folder, "
                         "here and on the workers.") from None
    _check_address(address)
    try:
        client = Client(address, timeout=_ANSWER_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise PoolUnavailable(f"no dask scheduler answers at {address} ({error}). Start one with `dask scheduler`, or "
                              "correct the address.") from None
    with client:
        if not _threads(client):
            raise PoolUnavailable(f"the dask scheduler at {address} has no workers. Start some with `dask worker "
                                  f"{address} --nthreads 1`, or wait for them, and start again.")
        _check_code(client, address)
        yield _Cluster(client)


def _check_address(address: str) -> None:
    """ValueError where no scheduler can have such an address. (A client that is made of one asks itself in vain, and
    complains when it is thrown away.)"""
    from distributed.comm.addressing import parse_address, parse_host_port
    from distributed.comm.registry import backends

    try:
        scheme, place = parse_address(address)
        if scheme not in backends:
            raise ValueError(f"'{scheme}' is none of {', '.join(sorted(backends))}")
        if scheme != "inproc":
            parse_host_port(place)
    except ValueError as error:
        raise ValueError(f"--scheduler {address} is no address of a dask scheduler ({error}). Give protocol, host and "
                         "port as `dask scheduler` prints them, for example tcp://10.0.0.1:8786.") from None


def _threads(client: Any) -> dict[str, int]:
    """Worker -> its threads; PoolUnavailable where tasks would run side by side in one process, whose CPU time and
    memory are then no one row's."""
    threads: dict[str, int] = client.nthreads()
    for worker, count in threads.items():
        if count > 1:
            raise PoolUnavailable(
                f"the dask worker {worker} has {count} threads, and a row's CPU time is that of its process. "
                "Start workers with `--nthreads 1` (a LocalCluster with threads_per_worker=1), as many as "
                "there are processors, and start again: what is finished is kept.")
    return threads


def _check_code(client: Any, address: str) -> None:
    try:
        for worker, (key, there) in client.run(_code).items():
            _compare(key_of({}), key, f"the dask worker {worker}", there)
    except ImportError as error:
        raise PoolUnavailable(f"a dask worker of {address} cannot load this package ({error}). Install it there as it "
                              "is here, restart the workers, and start again.") from None


def _code() -> tuple[str, dict[str, str]]:
    return key_of({}), versions()


def _compare(requested: str, key: str, worker: str, there: dict[str, str]) -> None:
    if key != requested:
        found = ", ".join(f"{name} {version}" for name, version in there.items())
        raise PoolUnavailable(
            f"{worker} runs other code or libraries than the sweep ({found}, {key[:12]}; requested {requested[:12]}). "
            "Install the same there, restart it, and start again: what is finished is kept.")


class _Cluster:
    """A client, and futures of the interface of concurrent.futures for its own. (Those of its `get_executor` stay
    pending for ever where a task cannot be computed again.)"""

    def __init__(self, client: Any) -> None:
        from distributed import KilledWorker

        self.losses = (KilledWorker, CancelledError)
        self._client = client
        self._size, self._asked_s = 0, float("-inf")
        # since when there are no workers, s of the monotonic clock
        self._alone_s: float | None = None

    def max_in_flight(self) -> int:
        """Two for every worker that is there now."""
        if time.monotonic() > self._asked_s + _SIZE_S:
            self._size, self._asked_s = 2 * len(_threads(self._client)), time.monotonic()
        return max(self._size, 2)

    def broadcast(self, task: Task) -> Submit:
        """Send the task to the scheduler once, as its own task: workers pass what it holds on to each other, and where
        all that had it are lost it is made again."""
        from dask import config

        with config.set({"distributed.admin.large-graph-warning-threshold": "1 GB"}):
            shared = self._client.submit(pickle.loads, pickle.dumps(task), pure=False)

        def submit(item: Any) -> Future[Any]:
            self._check_scheduler()
            answer: Future[Any] = Future()
            sent = self._client.submit(_called, key_of({}), shared, item, pure=False)
            sent.add_done_callback(partial(self._pass_on, answer))
            return answer
        return submit

    def look(self) -> None:
        """PoolUnavailable where the scheduler is gone, or no worker came for some minutes."""
        self._check_scheduler()
        try:
            there = self._client.nthreads()
        except OSError:
            raise PoolUnavailable(_GONE) from None
        now = time.monotonic()
        if there:
            self._alone_s = None
        elif self._alone_s is None:
            self._alone_s = now
            logging.getLogger(__name__).warning(
                "the dask cluster has lost all its workers; waiting %.3g min for others", _WITHOUT_S / 60)
        elif now > self._alone_s + _WITHOUT_S:
            raise PoolUnavailable(f"the dask cluster has had no workers for {_WITHOUT_S / 60:.3g} min. Start some, and "
                                  "the same command again: what is finished is kept.")

    def _check_scheduler(self) -> None:
        if self._client.status != "running":
            raise PoolUnavailable(_GONE)

    def _pass_on(self, answer: Future[Any], done: Any) -> None:
        try:
            answer.set_result(done.result(timeout=_FETCH_S))
        except CancelledError as error:
            answer.set_exception(error if self._client.status == "running" else PoolUnavailable(_GONE))
        except TimeoutError as error:
            late = CancelledError(f"its result did not come within {_FETCH_S:g} s")
            own = error if done.status == "error" else late
            answer.set_exception(own if self._client.status == "running" else PoolUnavailable(_GONE))
        except BaseException as error:
            answer.set_exception(error)


def _called(requested: str, task: Task, item: Any) -> Any:
    _compare(requested, key_of({}), "a dask worker that joined", versions())
    return task(item)
