import json
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.paper.stages import BEGUN, RECORD, Stage, key, made, read_record, state
from benchmarks.paper.stages_plan import FULL, QUICK, planned, stale
from eitsim.sweeps.dataset.parquet import write_manifest
from touchcal.cache import key_of


def tidied(folder: Path) -> Stage:
    """A stage that lays out a JSON file anew."""
    source = folder / "in.json"
    if not source.exists():
        source.write_text('{"a": 1}')
    out = folder / "work" / "out.json"
    return Stage("tidied", folder / "work", ("json.tool", source, out), (source,), "code")


def test_a_stage_is_made_once(tmp_path: Path) -> None:
    stage = tidied(tmp_path)
    assert state(stage) == "missing"
    assert made(stage)
    assert json.loads((tmp_path / "work" / "out.json").read_text()) == {"a": 1}
    record = read_record(stage.folder)
    assert record is not None
    assert record["wall_s"] > 0
    assert state(stage) == "current"
    assert not made(stage)


@pytest.mark.parametrize("change", ["input", "result", "code", "command"])
def test_a_stage_is_stale_once_anything_of_it_changed(tmp_path: Path, change: str) -> None:
    stage = tidied(tmp_path)
    made(stage)
    if change == "input":
        (tmp_path / "in.json").write_text('{"a": 2}')
    elif change == "result":
        (tmp_path / "work" / "out.json").write_text("{}")
    elif change == "code":
        stage = replace(stage, code="another")
    else:
        stage = replace(stage, command=(*stage.command, "--sort-keys"))
    assert state(stage) == "stale"
    assert made(stage)
    assert state(stage) == "current"


def test_a_stage_that_fails_says_why_and_is_made_once_it_is_mended(tmp_path: Path) -> None:
    stage = tidied(tmp_path)
    (tmp_path / "in.json").write_text("{")
    with pytest.raises(ValueError, match=r"stage tidied failed with exit status 1: .*Expecting.*start again"):
        made(stage)
    assert state(stage) == "missing"
    (tmp_path / "in.json").write_text("{}")
    assert made(stage)


@pytest.mark.parametrize(("goes_on", "same", "stays"), [(True, True, True), (True, False, False), (False, True, False)])
def test_what_a_stopped_command_left_stays_only_where_it_goes_on(tmp_path: Path, goes_on: bool, same: bool,
                                                                 stays: bool) -> None:
    stage = replace(tidied(tmp_path), goes_on=goes_on)
    stage.folder.mkdir()
    (stage.folder / "half").write_text("done")
    (stage.folder / BEGUN).write_text(json.dumps(key(stage) if same else "another"))
    made(stage)
    assert (stage.folder / "half").exists() == stays
    assert (stage.folder / RECORD).is_file()


def test_keys_know_neither_place_nor_processes(tmp_path: Path) -> None:
    one, other = (planned(QUICK, tmp_path / name, workers=k) for k, name in enumerate(("one", "other"), 1))
    card = [name for name, stage in one.stages.items() if all(path.exists() for path in stage.inputs)]
    assert {"card", "cycles"} <= set(card)
    assert [key(one.stages[name]) for name in card] == [key(other.stages[name]) for name in card]


def test_settings_differ_in_scenes_and_steps_alone(tmp_path: Path) -> None:
    quick, full = (planned(setting, tmp_path) for setting in (QUICK, FULL))
    different = [name for name in quick.stages if quick.stages[name].command != full.stages[name].command]
    assert different == ["sweep", "networks"]


def test_given_results_are_not_made(tmp_path: Path) -> None:
    run = planned(FULL, tmp_path, card=tmp_path / "card.json", sweep=tmp_path / "set")
    assert not {"card", "sweep"} & set(run.stages)
    assert run.stages["forward"].inputs == (tmp_path / "set",)
    assert tmp_path / "card.json" in run.stages["touch"].inputs


@pytest.mark.parametrize(("code", "told"), [(None, False), ("0" * 64, True)])
def test_a_given_sweep_is_stale_where_other_code_made_it_alone(tmp_path: Path, code: str | None, told: bool) -> None:
    write_manifest(tmp_path, {"design": {"scenes": 1, "tables": {}}, "card": None, "versions": {},
                              "code": code or key_of({})})
    run = planned(QUICK, tmp_path / "stages", card=tmp_path / "card.json", sweep=tmp_path)
    assert ("sweep" in stale(run)) == told
