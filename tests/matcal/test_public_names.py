"""The public names of matcal: light to import; `fit` is the command `matcal fit`, from files, arrays and tables."""

from __future__ import annotations

import doctest
import inspect
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import matcal
from matcal.cli.main import main
from matcal.posterior import ensembles
from matcal.posterior.draws import read_draws
from touchcal.errors import NotConverged

DATA = Path(__file__).parents[2] / "data_raw"
CURVES = [DATA / "uniaxial.csv", DATA / "shear.csv"]
PUBLIC = {"Calibration", "Conductivity", "Damage", "Experiment", "FitOptions", "Hyperfoam", "MaterialCard", "Prony",
          "check", "export", "fit", "follow_path", "import_deck", "inspect", "next_tests", "nominal_stress", "predict",
          "read_card", "read_test", "stability", "write_card"}


def parts(card: Path) -> str:
    """The text of a card's JSON but for date and CPU seconds."""
    held: dict[str, Any] = json.loads(card.read_text())
    del held["provenance"]["date"], held["provenance"]["cpu_s"]
    held.get("posterior", {}).get("checks", {}).pop("cpu_s", None)
    return json.dumps(held)


@pytest.fixture(scope="module")
def fitted() -> matcal.Calibration:
    return matcal.fit(CURVES, order=2)


def test_the_public_names_are_these_and_each_has_an_example(monkeypatch: pytest.MonkeyPatch) -> None:
    assert set(matcal.__all__) == set(dir(matcal)) == PUBLIC
    functions = [thing for name in PUBLIC if inspect.isfunction(thing := getattr(matcal, name))]
    assert len(functions) == 13
    monkeypatch.chdir(DATA.parent)
    for function in functions:
        tests = doctest.DocTestFinder().find(function, function.__name__, globs={})
        runner = doctest.DocTestRunner()
        assert sum(runner.run(test).attempted for test in tests) > 1 or function is matcal.write_card, function
        assert runner.summarize(verbose=False).failed == 0, function
    with pytest.raises(AttributeError, match="it exports"):
        matcal.calibrat  # noqa: B018
    folders = {path.stem for path in Path(matcal.__file__).parent.iterdir()}
    assert not folders & PUBLIC


def test_importing_matcal_loads_nothing_heavy() -> None:
    loaded = subprocess.run([sys.executable, "-c", "import matcal, sys; print(*sys.modules)"], capture_output=True,
                            text=True, check=True).stdout.split()
    assert not {"numpy", "scipy", "pandas", "typer", "rich"} & set(loaded)
    assert len([name for name in loaded if name.startswith("matcal")]) == 1


def test_fit_from_files_is_the_command(fitted: matcal.Calibration, tmp_path: Path,
                                       monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    monkeypatch.setattr(sys, "argv", ["matcal", "fit", *map(str, CURVES), "--order", "2", "--json", "--out",
                                      str(tmp_path / "a" / "foam.json")])
    with pytest.raises(SystemExit, match=r"^0$"):
        main()
    saved = fitted.save(tmp_path / "b" / "foam.json").card
    assert parts(tmp_path / "a" / "foam.json") == parts(tmp_path / "b" / "foam.json")
    assert saved.provenance["synthetic"] is True
    assert [p.name for p in sorted((tmp_path / "b" / "foam.d").iterdir())] == [
        p.name for p in sorted((tmp_path / "a" / "foam.d").iterdir())]
    assert saved.file == tmp_path / "b" / "foam.json"
    assert saved.name == matcal.read_card(saved.file).name == "foam"


def test_arrays_tables_and_tests_read_before_give_the_law_of_their_files(fitted: matcal.Calibration) -> None:
    uniaxial, shear = (matcal.read_test(path) for path in CURVES)
    arrays = matcal.fit({"uniaxial": (uniaxial.strain, uniaxial.value), "shear": [shear.strain, shear.value]}, order=2)
    frame = pd.DataFrame({"strain": uniaxial.strain, "stress_Pa": uniaxial.value})
    mixed = matcal.fit([{"uniaxial": frame}, f"shear={CURVES[1]}"], order=2)
    before = matcal.fit([uniaxial, shear], options=matcal.FitOptions(order=2))
    law = fitted.card.hyperfoam
    assert law is not None
    for found in (arrays, mixed, before):
        own = found.card.hyperfoam
        assert own is not None
        for name in ("mu_Pa", "alpha", "nu"):
            np.testing.assert_array_equal(getattr(own, name), getattr(law, name))
        assert own.strain_range == law.strain_range
    assert arrays.card.provenance["files"] == []
    assert arrays.card.provenance["synthetic"] is False
    assert before.card.provenance["files"] == fitted.card.provenance["files"]
    assert before.card.provenance["synthetic"] is True
    assert "uniaxial arrays: uniaxial, as given." in arrays.card.provenance["decisions"][0]


def test_two_files_of_one_test_are_given_by_its_kind() -> None:
    found = matcal.fit({"conductivity": [DATA / "mts_stretch.txt", DATA / "nova_stretch.txt"]},
                       DATA / "specimen.toml").card
    same = matcal.fit(f"conductivity={DATA / 'mts_stretch.txt'},{DATA / 'nova_stretch.txt'}",
                      str(DATA / "specimen.toml")).card
    assert found.conductivity is not None
    assert same.conductivity is not None
    assert found.conductivity.c0_S_per_m == same.conductivity.c0_S_per_m
    assert [f["name"] for f in found.provenance["files"]] == ["mts_stretch.txt", "nova_stretch.txt", "specimen.toml"]


@pytest.mark.parametrize(("given", "message"), [
    (3, "object is not iterable"), ([3], "a test is given as int"),
    ({"uniaxial": ([0.0, -0.1],)}, "1 arrays; expected"),
    ({"uniaxial": {"strain": [0.0], "stress": [0.0]}}, "'stress' is unknown; known, in SI"),
    ({"uniaxial": ([0.0, np.nan, -0.1], [0.0, -1.0, -2.0])}, "finite numbers"),
    ({"squeeze": ([0.0, -0.1, -0.2], [0.0, -1.0, -2.0])}, "kind 'squeeze' is unknown"),
    ({"relaxation": ([0.0, -0.1, -0.2], [0.0, -1.0, -2.0])}, "needs a time column"),
])
def test_a_test_that_is_none_says_what_was_expected(given: Any, message: str) -> None:
    with pytest.raises((ValueError, TypeError), match=message):
        matcal.fit(given)


def test_choices_that_nothing_obeys_are_refused() -> None:
    with pytest.raises(TypeError, match="ordr"):
        matcal.fit(CURVES, ordr=2)
    with pytest.raises(ValueError, match="no law is held stable"):
        matcal.fit(CURVES, stable_range=(0.5, 1.5))
    with pytest.raises(ValueError, match="needs a relaxation, creep or dynamic test"):
        matcal.fit(CURVES, prony_terms=2)
    with pytest.raises(ValueError, match="reads one test"):
        matcal.read_test({"uniaxial": CURVES[0], "shear": CURVES[1]})


def test_a_card_is_taken_as_its_file_or_itself(fitted: matcal.Calibration, tmp_path: Path) -> None:
    path = tmp_path / "foam.json"
    matcal.write_card(fitted.card, path)
    for card in (path, str(path), matcal.read_card(path)):
        np.testing.assert_array_equal(matcal.predict(card, "shear", [0.5])["stress_Pa"],
                                      matcal.predict(fitted.card, "shear", [0.5])["stress_Pa"])
        assert matcal.check(card) == matcal.check(fitted.card)
        assert matcal.export(card, "abaqus").text == matcal.export(fitted.card, "abaqus").text


@pytest.mark.slow
def test_a_sampler_that_stops_short_carries_the_calibration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ensembles, "MOST_STEPS", 1)
    steps: list[int] = []
    with pytest.raises(NotConverged, match="posterior") as stopped:
        matcal.fit(CURVES, order=3, posterior=True, progress=steps.append)
    found = stopped.value.estimate
    assert isinstance(found, matcal.Calibration)
    assert steps == [ensembles.CHUNK]
    with pytest.raises(ValueError, match="was not saved"):
        read_draws(found.card)
    card = found.save(tmp_path / "card.json").card
    assert card.posterior["checks"]["converged"] is False
    assert len(read_draws(card)) == card.posterior["n"]
    band = matcal.predict(card, "uniaxial", [-0.3])
    assert band["stress_lo_Pa"] < band["stress_Pa"] < band["stress_hi_Pa"]


def test_saving_spares_a_folder_of_something_else(fitted: matcal.Calibration, tmp_path: Path) -> None:
    (tmp_path / "foam.d").mkdir()
    (tmp_path / "foam.d" / "notes.txt").write_text("mine")
    with pytest.raises(ValueError, match=r"notes\.txt"):
        fitted.save(tmp_path / "foam.json")
    assert (tmp_path / "foam.d" / "notes.txt").read_text() == "mine"


def test_a_fit_shows_its_laws_in_a_line(fitted: matcal.Calibration) -> None:
    assert "mu_Pa=" in repr(fitted)
    assert len(repr(fitted)) < 600
