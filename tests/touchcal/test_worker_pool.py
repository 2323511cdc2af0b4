"""Whoever works, every item is answered once; a lost worker costs its item a try, a broken item only itself."""

import json
import threading
import time
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import fields

import numpy
import pytest
import threadpoolctl

from eitsim.mechanics.load_paths.load_path import Deviation, Node
from touchcal.array_store import from_arrays, to_arrays
from touchcal.parallel.checkpoint import CheckpointedMap
from touchcal.parallel.pool import ExecutorPool, Failed, InProcess, PoolUnavailable, WorkerLost, WorkerPool, answers
from touchcal.parallel.processes import processes

DIE = "__import__('os')._exit(9)"
KILLED = "__import__('os').kill(__import__('os').getpid(), 9)"


def by_item(pool: WorkerPool, items: list[str], tries: int = 2) -> dict[str, object]:
    return dict(answers(pool, eval, items, tries))


def test_every_item_is_answered_by_anyone() -> None:
    items = [f"{i} * {i}" for i in range(9)]
    expected = {item: i * i for i, item in enumerate(items)}
    assert by_item(InProcess(), items) == expected
    with ThreadPoolExecutor(2) as threads:
        assert by_item(ExecutorPool(threads, 4), items) == expected
    with processes(2) as pool:
        assert by_item(pool, items) == expected


def test_what_an_item_does_costs_no_other_one() -> None:
    with processes(2) as pool:
        found = by_item(pool, ["1", DIE, "1 / 0", KILLED, "2", "3"])
    broken = {item: found.pop(item) for item in (DIE, "1 / 0", KILLED)}
    assert found == {"1": 1, "2": 2, "3": 3}
    assert all(isinstance(value, Failed) for value in broken.values())
    assert {item: (value.lost, value.reason) for item, value in broken.items() if isinstance(value, Failed)} == {
        DIE: (True, "its process ended with status 9"), "1 / 0": (False, "ZeroDivisionError: division by zero"),
        KILLED: (True, "its process was killed by signal 9")}


def test_linear_algebra_has_one_thread_wherever_it_is() -> None:
    asked = "max(pool['num_threads'] for pool in __import__('threadpoolctl').threadpool_info())"
    assert by_item(InProcess(), [f"__import__('numpy') and {asked}"]) == {f"__import__('numpy') and {asked}": 1}
    variables = "[__import__('os').environ[name] for name in ('OMP_NUM_THREADS', 'NUMBA_NUM_THREADS')]"
    with processes(2) as pool:
        assert by_item(pool, [variables]) == {variables: ["1", "1"]}


def test_tasks_that_overlap_in_one_process_keep_each_other_to_one_thread() -> None:
    numpy.linalg.solve(numpy.eye(3), numpy.ones(3))

    def most() -> int:
        return max(pool["num_threads"] for pool in threadpoolctl.threadpool_info())

    begun, first_gone = threading.Barrier(2, timeout=30), threading.Event()

    def work(name: str) -> int:
        begun.wait()
        if name == "long":
            first_gone.wait(30)
        return most()

    with threadpoolctl.threadpool_limits(2), ThreadPoolExecutor(2) as threads:
        assert most() == 2
        found = {}
        for name, value in answers(ExecutorPool(threads, 2), work, ["short", "long"]):
            found[name] = value
            first_gone.set()
        assert found == {"short": 1, "long": 1}
        assert most() == 2


def test_few_items_are_out_at_a_time() -> None:
    taken = []

    def items():
        for i in range(40):
            taken.append(i)
            yield str(i)
    with ThreadPoolExecutor(2) as threads:
        for answered, _ in enumerate(answers(ExecutorPool(threads, 4), eval, items())):
            assert len(taken) <= answered + 4
    assert len(taken) == 40


def test_a_large_answer_cut_off_by_a_kill_does_not_block() -> None:
    half = ("[__import__('threading').Timer(0.3, __import__('os').kill, (__import__('os').getpid(), 9)).start(), "
            "b'0' * 400_000_000][1]")
    began = time.monotonic()
    with processes(2) as pool:
        found = by_item(pool, [half, "1"], tries=1)
    assert found["1"] == 1
    assert time.monotonic() - began < 60


def test_nobody_left_is_said() -> None:
    with ProcessPoolExecutor(1) as pool:
        pass
    with pytest.raises(PoolUnavailable, match="takes no more work"):
        by_item(ExecutorPool(pool, 2), ["1"])


class Losing:
    """Loses its worker on the items named."""

    losses = (WorkerLost,)

    def __init__(self, *items: object) -> None:
        self.items, self.seen = items, []

    def look(self) -> None:
        pass

    def max_in_flight(self) -> int:
        return 1

    def broadcast(self, task):
        def submit(item):
            self.seen.append(item)
            done: Future = Future()
            if item[1] in self.items:
                done.set_exception(WorkerLost("its process was killed by signal 9"))
            else:
                done.set_result(task(item))
            return done
        return submit


def test_values_are_kept_as_arrays_and_nothing_of_others_is_run(tmp_path) -> None:
    node = Node(0.1, numpy.asfortranarray(numpy.random.default_rng(1).random((6, 4))), numpy.full((6, 4), numpy.nan),
                numpy.arange(6.0), numpy.zeros(11), 1 / 3, ())
    value = ([node], (None, 0.1, "a", True), Deviation(1e-3, numpy.full(3, 0.2), numpy.float64(0.5)),
             numpy.float32([0.1]))
    numpy.savez(tmp_path / "a.npz", **to_arrays(value))
    with numpy.load(tmp_path / "a.npz", allow_pickle=False) as file:
        found = from_arrays(dict(file))
    assert found[1] == value[1]
    assert (found[2].depth, found[2].strain) == (1e-3, 0.5)
    assert found[2].signals.tolist() == [0.2, 0.2, 0.2]
    assert found[3].dtype == numpy.float32
    for one in fields(Node):
        numpy.testing.assert_array_equal(getattr(found[0][0], one.name), getattr(node, one.name))
    with pytest.raises(TypeError, match="set is not kept"):
        to_arrays({1})
    for foreign in (["os", "system"], ["touchcal.cache", "clear"]):
        with pytest.raises(TypeError, match="no dataclass of this package"):
            from_arrays({"tree": numpy.array(json.dumps({"class": foreign, "parts": {}}))})


def test_pieces_of_a_stopped_computation_are_kept(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TOUCHCAL_CACHE", str(tmp_path))
    first = Losing("3")
    with pytest.raises(PoolUnavailable, match=r"killed by signal 9\. What is finished is kept, and the same command"):
        CheckpointedMap(first)(eval, ["1", "2", "3", "4"])
    second = Losing()
    checkpointed = CheckpointedMap(second)
    assert checkpointed(eval, ["1", "2", "3", "4"]) == [1, 2, 3, 4]
    assert [item for _, item in second.seen] == ["3", "4"]
    checkpointed.forget()
    assert not list(tmp_path.glob("*.npz"))


def test_a_piece_whose_class_has_moved_is_solved_again(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TOUCHCAL_CACHE", str(tmp_path))
    for moved in (["eitsim.gone", "Node"], ["eitsim.mechanics.load_paths.load_path", "Gone"]):
        monkeypatch.setattr("touchcal.parallel.checkpoint.to_arrays", lambda value, moved=moved: {
            "tree": numpy.array(json.dumps({"class": moved, "parts": {}}))})
        assert CheckpointedMap(Losing())(eval, ["1"]) == [1]
        again = Losing()
        assert CheckpointedMap(again)(eval, ["1"]) == [1]
        assert len(again.seen) == 1
