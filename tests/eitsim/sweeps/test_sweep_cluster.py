"""On a dask cluster a sweep makes the same rows, whatever becomes of its workers."""

import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError, Future
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest

from eitsim.simulation import reuse
from eitsim.sweeps.dataset.parquet import COST, read_dataset
from eitsim.sweeps.design.design import design_from
from eitsim.sweeps.run import sweep as sweeping
from eitsim.sweeps.run.sweep import Progress, sweep
from matcal.card import MaterialCard, write_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.parallel.dask_cluster import _Cluster, cluster
from touchcal.parallel.pool import PoolUnavailable, answers

distributed = pytest.importorskip("distributed")
psutil = pytest.importorskip("psutil")

RAW = {"seed": 7, "punch": {"x_mm": [-35, 35], "y_mm": [-35, 35], "diameter_mm": 14, "force_N": [0.262, 0.298]},
       "accuracy": {"signal": 0.05}}
FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm")
SCENES = 30


@pytest.fixture
def card(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TOUCHCAL_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(reuse, "DEPTHS", (0.065, 0.07, 0.075))
    monkeypatch.setattr(sweeping, "ROWS_FROM_TABLE", 3)
    write_card(MaterialCard("Table 1", FOAM, None, Conductivity(30.0, [-2, 2, -1], (0, 0.4))), tmp_path / "card.json")
    return tmp_path / "card.json"


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as made:
        yield made.scheduler_address


def rows(folder: Path) -> pd.DataFrame:
    return read_dataset(folder).table.drop(columns=[*COST])


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_makes_the_rows_of_one_process(card: Path, tmp_path: Path, address: str) -> None:
    killed = []

    def kill(step: Progress) -> None:
        if step.done and not killed:
            with distributed.Client(address, set_as_default=False) as client:
                pid = next(iter(client.run(lambda: __import__("os").getpid()).values()))
            psutil.Process(pid).kill()
            killed.append(pid)

    account = sweep(design_from(RAW, SCENES), card, tmp_path / "a", scheduler=address, reuse=True,
                    progress=kill).account
    assert killed
    assert account is not None
    assert dict(account.outcomes) == {"ok": SCENES}
    sweep(design_from(RAW, SCENES), card, tmp_path / "b", reuse=True)
    pd.testing.assert_frame_equal(rows(tmp_path / "a"), rows(tmp_path / "b"), check_exact=True)


def test_no_scheduler_or_no_workers_is_said(card: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("touchcal.parallel.dask_cluster._ANSWER_S", 0.5)
    with pytest.raises(PoolUnavailable, match=r"no dask scheduler answers at tcp://127.0.0.1:9"), cluster("tcp://127.0.0.1:9"):
        pass
    with (distributed.LocalCluster(n_workers=0, dashboard_address=None) as empty,
          pytest.raises(PoolUnavailable, match="has no workers"), cluster(empty.scheduler_address)):
        pass


def test_without_a_scheduler_nothing_is_written(card: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("touchcal.parallel.dask_cluster._ANSWER_S", 0.2)
    with pytest.raises(PoolUnavailable, match="no dask scheduler answers"):
        sweep(design_from(RAW, SCENES), card, tmp_path / "set", scheduler="tcp://127.0.0.1:9", reuse=True)
    assert not (tmp_path / "set").exists()


@pytest.mark.parametrize("address", ["localhost", "tcp://localhost", "tcp://10.0.0.1:some", "http://10.0.0.1:8786", ""])
def test_what_is_no_address_is_refused_before_a_client_is_made(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr("distributed.Client.__init__")
    with pytest.raises(ValueError, match=r"--scheduler .* no address .* tcp://10\.0\.0\.1:8786"), cluster(address):
        pass


def local(threads: int):
    return distributed.LocalCluster(n_workers=1, threads_per_worker=threads, processes=False, dashboard_address=None)


def test_workers_of_several_threads_are_refused_at_once_and_when_they_join(monkeypatch: pytest.MonkeyPatch) -> None:
    with (local(2) as made, pytest.raises(PoolUnavailable, match=r"has 2 threads.*--nthreads 1"),
          cluster(made.scheduler_address)):
        pass
    monkeypatch.setattr("touchcal.parallel.dask_cluster._SIZE_S", 0.0)
    with local(1) as made, cluster(made.scheduler_address) as pool:
        assert pool.max_in_flight() == 2
        monkeypatch.setattr("distributed.Client.nthreads", lambda _: {"tcp://10.0.0.2:1": 4})
        with pytest.raises(PoolUnavailable, match="has 4 threads"):
            pool.max_in_flight()


def test_workers_of_other_code_are_refused_at_once_and_when_they_join(address: str,
                                                                      monkeypatch: pytest.MonkeyPatch) -> None:
    with cluster(address) as pool:
        monkeypatch.setattr("touchcal.parallel.dask_cluster.key_of", lambda _: "0" * 64)
        with pytest.raises(PoolUnavailable, match=r"worker that joined runs other code.*requested 0000.*restart it"):
            list(answers(pool, abs, [-1]))
    with pytest.raises(PoolUnavailable, match=r"tcp://.* runs other code or libraries"), cluster(address):
        pass


def test_a_cluster_without_workers_is_waited_for_a_while(monkeypatch: pytest.MonkeyPatch,
                                                         caplog: pytest.LogCaptureFixture) -> None:
    monkeypatch.setattr("touchcal.parallel.pool._LOOK_S", 0.2)
    monkeypatch.setattr("touchcal.parallel.dask_cluster._WITHOUT_S", 1.0)
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as made:
        with cluster(made.scheduler_address) as pool:
            made.scale(0)
            with pytest.raises(PoolUnavailable, match="has had no workers"):
                list(answers(pool, abs, [-1]))
        assert "lost all its workers" in caplog.text


def test_a_scheduler_that_goes_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("touchcal.parallel.pool._LOOK_S", 0.2)
    code = ("import distributed, time\nif __name__ == '__main__':\n"
            "    made = distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False,\n"
            "                                    protocol='tcp://', dashboard_address=None)\n"
            "    print(made.scheduler_address, flush=True)\n    time.sleep(100)")
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        with cluster(process.stdout.readline().strip()) as pool:
            threading.Timer(1.0, process.kill).start()
            with pytest.raises(PoolUnavailable, match="the dask scheduler is gone"):
                list(answers(pool, time.sleep, [60.0]))
    finally:
        process.kill()
        process.communicate()


@pytest.mark.parametrize(("client", "task", "error", "told"), [
    ("running", "finished", TimeoutError(), CancelledError), ("closed", "finished", TimeoutError(), PoolUnavailable),
    ("running", "error", TimeoutError("of the row"), TimeoutError),
    ("closed", "cancelled", CancelledError(), PoolUnavailable)])
def test_a_result_that_does_not_come_is_lost_or_its_scheduler_is(client: str, task: str, error: BaseException,
                                                                told: type[BaseException]) -> None:
    """A task's own error stays its own."""
    def late(timeout: float) -> None:
        raise error

    answer: Future[object] = Future()
    _Cluster(SimpleNamespace(status=client))._pass_on(answer, SimpleNamespace(status=task, result=late))
    assert type(answer.exception()) is told
