"""Sweeps: rows depend on design and card alone, a stopped sweep goes on, another design or card is refused."""

import errno
import json
import re
import resource
from concurrent.futures import Future
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from eitsim.cli.progress import shown
from eitsim.sweeps.dataset.outcome_counts import OutcomeCounts
from eitsim.sweeps.dataset.parquet import (
    COST,
    IDENTITY,
    MANIFEST,
    decoded,
    encoded,
    parts,
    read_dataset,
    read_manifest,
    with_rows,
)
from eitsim.sweeps.dataset.sweep_record import Account
from eitsim.sweeps.design.card_draws import Cards
from eitsim.sweeps.design.design import Design, design_from
from eitsim.sweeps.run import sweep as sweeping
from eitsim.sweeps.run.parts import solved_parts
from eitsim.sweeps.run.rows import crashed_row
from eitsim.sweeps.run.scene_table import read_scene_table
from eitsim.sweeps.run.sweep import Progress, sweep
from matcal.card import MaterialCard, read_card, write_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.errors import InputFileError
from touchcal.parallel.pool import WorkerLost

pytestmark = pytest.mark.usefixtures("solved_once")
RAW = {"seed": 7, "punch": {"x_mm": [-35, 35], "y_mm": [-35, 35], "diameter_mm": [12, 16], "force_N": [0.2, 1.0]},
       "accuracy": {"signal": 0.05}}


@pytest.fixture
def card(tmp_path: Path) -> Path:
    foam = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm")
    write_card(MaterialCard("Table 1", foam, None, Conductivity(30.0, [-2, 2, -1], (0, 0.4))), tmp_path / "card.json")
    return tmp_path / "card.json"


def account(design: Design, card: Path, folder: Path, workers: int = 1) -> Account:
    last = sweep(design, card, folder, workers=workers).account
    assert last is not None
    return last


@pytest.mark.slow
def test_a_continued_sweep_equals_one_in_a_go_on_any_number_of_workers(card: Path, tmp_path: Path) -> None:
    assert account(design_from(RAW, 3), card, tmp_path / "a").solved == 3
    first = read_dataset(tmp_path / "a").table
    grown = account(design_from(RAW, 6), card, tmp_path / "a", workers=2)
    assert (grown.kept, grown.solved, dict(grown.outcomes)) == (3, 3, {"ok": 6})
    account(design_from(RAW, 6), card, tmp_path / "b")
    a, b = (read_dataset(tmp_path / name).table.drop(columns=[*COST]) for name in "ab")
    pd.testing.assert_frame_equal(a, b)
    pd.testing.assert_frame_equal(a.head(3), first.drop(columns=[*COST]))


@pytest.mark.thorough
def test_a_lost_part_is_made_again(card: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweeping, "ROWS_AFRESH", 2)
    account(design_from(RAW, 5), card, tmp_path / "a")
    whole = read_dataset(tmp_path / "a").table.drop(columns=[*COST])
    monkeypatch.undo()
    assert [path.name for path in parts(tmp_path / "a")] == [f"part-{first:09d}.parquet" for first in (0, 2, 4)]
    parts(tmp_path / "a")[1].unlink()
    assert account(design_from(RAW, 5), card, tmp_path / "a").solved == 2
    pd.testing.assert_frame_equal(read_dataset(tmp_path / "a").table.drop(columns=[*COST]), whole)


def test_what_takes_its_worker_with_it_is_a_row(card: Path) -> None:
    class Fragile:
        """Loses its worker wherever scene 2 is among its rows, and raises at scene 5."""

        losses = (WorkerLost,)

        def look(self) -> None:
            pass

        def max_in_flight(self) -> int:
            return 2

        def broadcast(self, task):
            def submit(scenes):
                done: Future = Future()
                if 2 in scenes:
                    done.set_exception(WorkerLost("its process was killed by signal 9"))
                elif 5 in scenes:
                    done.set_exception(MemoryError("too large"))
                else:
                    done.set_result(task(scenes))
                return done
            return submit

    todo = [range(0, 3), range(3, 5), range(5, 6)]
    found = list(solved_parts(Fragile(), design_from(RAW, 6), Cards(read_card(card)), todo, exact=False, table=None))
    assert sorted((part.scenes.start, part.scenes.stop) for part in found) == [(0, 3), (3, 5), (5, 6)]
    table = pd.concat([decoded(part.content) for part in found]).set_index("scene").sort_index()
    assert table["outcome"].tolist() == ["ok", "ok", "crashed", "ok", "ok", "crashed"]
    assert table["message"][2] == "its process was killed by signal 9"
    assert table["message"][5] == "MemoryError: too large"
    assert table["x_mm"].notna().all()
    assert sum((part.counts for part in found), OutcomeCounts()).outcomes == {"ok": 4, "crashed": 2}


def test_a_part_that_cannot_be_written_leaves_the_others(card: Path, tmp_path: Path,
                                                         monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweeping, "ROWS_AFRESH", 2)
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)

    def fill(step: Progress) -> None:
        if step.done >= 2:
            resource.setrlimit(resource.RLIMIT_FSIZE, (4096, limit[1]))

    try:
        with pytest.raises(OSError, match="What is finished is kept"):
            sweep(design_from(RAW, 4), card, tmp_path / "a", progress=fill)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == [".lock", MANIFEST, "part-000000000.parquet"]
    assert account(design_from(RAW, 4), card, tmp_path / "a").kept == 2


def test_leftovers_are_swept_and_strangers_named(card: Path, tmp_path: Path) -> None:
    account(design_from(RAW, 1), card, tmp_path / "a")
    (tmp_path / "a" / ".part-half.tmp").write_bytes(b"PAR1")
    account(design_from(RAW, 1), card, tmp_path / "a")
    assert not list((tmp_path / "a").glob(".part-*"))
    (part,) = parts(tmp_path / "a")
    content = part.read_bytes()
    part.write_bytes(content[:len(content) // 2] + bytes(len(content) - len(content) // 2))
    with pytest.raises(InputFileError, match="part is damaged"):
        account(design_from(RAW, 1), card, tmp_path / "a")
    part.rename(part.with_name("part-000000007.parquet")).write_bytes(content)
    with pytest.raises(InputFileError, match="does not belong to this sweep"):
        account(design_from(RAW, 1), card, tmp_path / "a")


def test_a_part_of_another_seed_is_named(card: Path, tmp_path: Path) -> None:
    for name, seed in (("a", 7), ("b", 8)):
        account(design_from(RAW | {"seed": seed}, 2), card, tmp_path / name)
    (part,), (other,) = parts(tmp_path / "a"), parts(tmp_path / "b")
    part.write_bytes(other.read_bytes())
    with pytest.raises(InputFileError, match=r"part-000000000\.parquet: the part does not belong to this sweep"):
        account(design_from(RAW | {"seed": 7}, 2), card, tmp_path / "a")
    with pytest.raises(InputFileError, match="does not belong to this sweep"):
        read_dataset(tmp_path / "a")


def test_lost_rows_are_counted(card: Path, tmp_path: Path, command) -> None:
    account(design_from(RAW, 2), card, tmp_path / "a")
    (part,) = parts(tmp_path / "a")
    part.write_bytes(encoded(decoded(part).head(1), read_manifest(tmp_path / "a")[IDENTITY]))
    (tmp_path / "m.toml").write_text("[measurement]\nnoise_V = 1e-6\n")
    done = command("eitsim", "measure", "a", "--model", "m.toml", "--out", "b", cwd=tmp_path)
    assert done.returncode == 0
    assert "a: 1 of its 2 scenes have no row" in done.stderr
    last = account(design_from(RAW, 2), card, tmp_path / "a")
    assert last.solved == 1
    assert "1 rows that were there before were lost and are solved again" in last.method


@pytest.mark.parametrize("changed", [{"rows_per_part": 0}, {"rows_per_part": "x"}, {"design": []}, {"card": None},
                                     {"runs": 3}, {"runs": [3]}, {"design": {"scenes": 1}}])
def test_a_manifest_that_was_changed_is_named(card: Path, tmp_path: Path, command, changed: dict) -> None:
    (tmp_path / "d.toml").write_text("scenes = 1\nseed = 7\n[punch]\nx_mm = 99.0\ny_mm = 0.0\n")
    sweep_of = ("eitsim", "sweep", "d.toml", "--card", card, "--out", "a", "--workers", 1)
    assert command(*sweep_of, cwd=tmp_path).returncode == 0
    altered(tmp_path / "a", **changed)
    done = command(*sweep_of, cwd=tmp_path)
    assert done.returncode == 2
    assert "design.json: " in done.stderr


@pytest.mark.parametrize("text", ["[]", "null", '{"schema": 2}', "[" * 200_000])
def test_a_manifest_that_is_none_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / MANIFEST).write_text(text)
    with pytest.raises(InputFileError, match=r"design\.json: "):
        read_manifest(tmp_path)


def test_a_folder_of_other_things_is_left_alone(card: Path, tmp_path: Path) -> None:
    folder = tmp_path / "letters"
    folder.mkdir()
    (folder / "letter.txt").write_text("dear")
    with pytest.raises(InputFileError, match=r"letters: it holds letter\.txt but no design\.json"):
        account(design_from(RAW, 1), card, folder)
    assert [path.name for path in folder.iterdir()] == ["letter.txt"]


def altered(folder: Path, **changed: object) -> None:
    """Change the manifest of a folder."""
    manifest = json.loads((folder / MANIFEST).read_text())
    (folder / MANIFEST).write_text(json.dumps(manifest | changed))


def test_other_code_is_refused_or_its_scenes_are_told(card: Path, tmp_path: Path) -> None:
    folder = tmp_path / "a"
    account(design_from(RAW, 2), card, folder)
    mine = read_manifest(folder)
    altered(folder, code="older", versions={"numpy": "1.0"})
    assert account(design_from(RAW, 2), card, folder).kept == 2  # nothing is added
    stood = (folder / MANIFEST).read_bytes()
    with pytest.raises(ValueError, match=r"numpy 1.0, older\) than these \(touchcal.*--other-code"):
        account(design_from(RAW, 3), card, folder)
    assert (folder / MANIFEST).read_bytes() == stood
    last = sweep(design_from(RAW, 3), card, folder, other_code=True).account
    assert last is not None
    assert "2 rows are of other code" in last.method
    found = read_manifest(folder)
    assert (found["code"], found["versions"]) == (mine["code"], mine["versions"])
    assert found["earlier_code"] == [{"code": "older", "versions": {"numpy": "1.0"}, "scenes": [[0, 1]]}]
    altered(folder, code="newer")
    sweep(design_from(RAW, 4), card, folder, other_code=True)
    assert [(one["code"], one["scenes"]) for one in read_manifest(folder)["earlier_code"]] == [
        ("older", [[0, 1]]), ("newer", [[2, 2]])]


def test_rows_of_other_columns_are_not_continued(card: Path, tmp_path: Path) -> None:
    account(design_from(RAW, 1), card, tmp_path / "a")
    (part,) = parts(tmp_path / "a")
    part.write_bytes(encoded(decoded(part).drop(columns="fraction_non_elliptic"),
                             read_manifest(tmp_path / "a")[IDENTITY]))
    with pytest.raises(ValueError, match=r"other columns \(fraction_non_elliptic\)"):
        sweep(design_from(RAW, 2), card, tmp_path / "a", other_code=True)


def test_a_file_system_without_locks_is_no_obstacle(card: Path, tmp_path: Path,
                                                    monkeypatch: pytest.MonkeyPatch) -> None:
    account(design_from(RAW, 1), card, tmp_path / "a")
    (tmp_path / "a" / ".part-other.tmp").touch()

    def unsupported(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")
    monkeypatch.setattr("fcntl.flock", unsupported)
    assert account(design_from(RAW, 2), card, tmp_path / "a").solved == 1
    assert (tmp_path / "a" / ".part-other.tmp").exists()


def test_two_writers_without_locks_double_no_row_of_a_growing_sweep(card: Path, tmp_path: Path,
                                                                    monkeypatch: pytest.MonkeyPatch) -> None:
    def unsupported(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")
    monkeypatch.setattr("fcntl.flock", unsupported)
    account(design_from(RAW, 1), card, tmp_path / "a")
    solved = []

    def another(step: Progress) -> None:
        """Once this sweep has seen what is there, another one writes the same rows."""
        if step.done == 1:
            solved.append(account(design_from(RAW, 3), card, tmp_path / "a").solved)

    found = sweep(design_from(RAW, 3), card, tmp_path / "a", progress=another).account
    assert found is not None
    assert [*solved, found.solved] == [2, 2]
    assert read_dataset(tmp_path / "a").table["scene"].tolist() == [0, 1, 2]


def test_crashed_rows_are_solved_again_by_the_same_command(card: Path, tmp_path: Path) -> None:
    account(design_from(RAW, 4), card, tmp_path / "a")
    (part,) = parts(tmp_path / "a")
    whole = decoded(part)
    design, cards = design_from(RAW, 4), Cards(read_card(card))
    rows = [crashed_row(design, cards, scene, "its process was killed by signal 9") for scene in (0, 2)]
    part.write_bytes(with_rows(part.read_bytes(), encoded(pd.DataFrame(rows)),
                               read_manifest(tmp_path / "a")[IDENTITY]))
    again = account(design, card, tmp_path / "a")
    assert (again.kept, again.solved, dict(again.outcomes), dict(again.reasons)) == (2, 2, {"ok": 4}, {})
    assert "2 rows that had crashed solved again" in again.method
    pd.testing.assert_frame_equal(decoded(part).drop(columns=[*COST]), whole.drop(columns=[*COST]), check_exact=True)
    assert account(design, card, tmp_path / "a").solved == 0


def test_two_sweeps_do_not_share_a_folder(card: Path, tmp_path: Path) -> None:
    def another(_: Progress) -> None:
        account(design_from(RAW, 1), card, tmp_path / "a")

    with pytest.raises(ValueError, match="another sweep is writing"):
        sweep(design_from(RAW, 1), card, tmp_path / "a", progress=another)
    assert account(design_from(RAW, 1), card, tmp_path / "a").solved == 1


def test_a_folder_of_an_earlier_version_is_read_not_continued(card: Path, tmp_path: Path) -> None:
    account(design_from(RAW, 1), card, tmp_path / "a")
    (part,) = parts(tmp_path / "a")
    part.rename(part.with_name("part-0000000-0000000.parquet"))
    manifest = json.loads((tmp_path / "a" / MANIFEST).read_text())
    (tmp_path / "a" / MANIFEST).write_text(json.dumps(manifest | {"schema": 1}))
    assert len(read_dataset(tmp_path / "a").ok) == 1
    with pytest.raises(ValueError, match="earlier version"):
        account(design_from(RAW, 2), card, tmp_path / "a")


def test_failures_are_rows(card: Path, tmp_path: Path) -> None:
    raw = RAW | {"punch": {"x_mm": {"choice": [20.0, 95.0]}, "y_mm": 0.0, "force_N": [0.2, 0.4]}}
    account(design_from(raw, 6), card, tmp_path / "a")
    table = read_dataset(tmp_path / "a").table
    refused = table[table["x_mm"] == 95.0]
    assert set(refused["outcome"]) == {"refused"}
    assert refused["message"].str.contains("rim").all()
    assert set(table.loc[table["x_mm"] == 20.0, "outcome"]) == {"ok"}
    assert np.isfinite(table.loc[table["outcome"] == "ok", "dv_207"]).all()


def test_what_a_solver_raises_is_a_crash_and_no_refusal(card: Path, tmp_path: Path,
                                                        monkeypatch: pytest.MonkeyPatch) -> None:
    def singular(*_: object, **__: object) -> None:
        raise np.linalg.LinAlgError("Singular matrix")
    monkeypatch.setattr("eitsim.sweeps.run.rows.solve_scene", singular)
    found = account(design_from(RAW, 2), card, tmp_path / "a")
    assert dict(found.outcomes) == {"crashed": 2}
    assert found.reasons["crashed"] == "LinAlgError: Singular matrix"


def test_a_pipe_is_quiet_unless_lines_are_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    steps = [Progress(0, 9, 0, {}, "table"), Progress(0, 9, 0, {}), Progress(3, 9, 0, {"ok": 3}),
             Progress(6, 9, 0, {"ok": 6})]
    with shown(9) as show:
        for step in steps:
            show(step)
    assert capsys.readouterr().err == ""
    with shown(9, 1e-9) as show:
        for step in steps:
            show(step)
    assert re.findall(r"^\d of 9 scenes", capsys.readouterr().err, re.MULTILINE) == ["3 of 9 scenes", "6 of 9 scenes"]
    with pytest.raises(ValueError, match="--log-every must be 0"), shown(9, -1.0):
        pass


def test_another_design_or_card_is_refused(card: Path, tmp_path: Path) -> None:
    account(design_from(RAW, 1), card, tmp_path / "a")
    with pytest.raises(ValueError, match="seed is 7, here 8"):
        account(design_from(RAW | {"seed": 8}, 1), card, tmp_path / "a")
    content = json.loads(card.read_text())
    content["hyperfoam"]["mu_Pa"][0] *= 1.01
    card.write_text(json.dumps(content))
    with pytest.raises(ValueError, match="another folder"):
        account(design_from(RAW, 1), card, tmp_path / "a")
    assert (tmp_path / "a" / MANIFEST).exists()


def test_a_card_without_what_is_needed_starts_nothing(card: Path, tmp_path: Path) -> None:
    content = json.loads(card.read_text())
    del content["conductivity"]
    card.write_text(json.dumps(content))
    with pytest.raises(ValueError, match="no conductivity"):
        account(design_from(RAW, 1), card, tmp_path / "a")
    assert not (tmp_path / "a").exists()


def test_columns_follow_the_drive(card: Path, tmp_path: Path) -> None:
    raw = RAW | {"drive": {"pattern": "opposite", "reading": "differential"}}
    assert account(design_from(raw, 2), card, tmp_path / "a").outcomes == {"ok": 2}
    table = read_dataset(tmp_path / "a").ok
    volts = table[[name for name in table.columns if name.startswith("dv_")]]
    assert volts.shape == (2, 16 * 12)
    assert np.all(np.isfinite(volts))


def test_a_table_of_scenes_may_grow_at_its_end(card: Path, tmp_path: Path) -> None:
    rows = ["x_mm,F_N,d_mm,x_2_mm", "10,0.2,12,", "-20,0.3,14,40"]
    (tmp_path / "scenes.csv").write_text("\n".join(rows))
    (tmp_path / "scene.toml").write_text("[accuracy]\nsignal = 0.2\n")

    def table() -> Design:
        return read_scene_table(tmp_path / "scenes.csv", tmp_path / "scene.toml")

    assert account(table(), card, tmp_path / "a").solved == 2
    (tmp_path / "scenes.csv").write_text("\n".join([*rows, "0,0.2,12,"]))
    grown = account(table(), card, tmp_path / "a")
    assert (grown.kept, grown.solved, dict(grown.outcomes)) == (2, 1, {"ok": 3})
    found = read_dataset(tmp_path / "a")
    assert found.table["x_mm"].tolist() == [10, -20, 0]
    assert found.table["touches"].tolist() == [1, 2, 1]
    assert found.design["source"]["file"] == "scenes.csv"
    (tmp_path / "scenes.csv").write_text("\n".join([*rows, "0,0.25,12,"]))
    with pytest.raises(ValueError, match="rows or columns that stood in it are changed or gone"):
        account(table(), card, tmp_path / "a")
