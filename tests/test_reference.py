"""Pages of reference: every key of a scene file with a meaning, and files under the names that the programs write."""

import importlib.util
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import jsonschema
import pytest

import eitsim
import matcal
from eitsim.sweeps.dataset.parquet import MANIFEST
from matcal import card as card_module
from surrogate.model import store
from touchcal.document import Keys, Number, check

ROOT = Path(__file__).parents[1]
SHAPE = Keys({"count": Number(0, 5, whole=True)}, {"name": (str, None), "pair": [Number(), Number(-1, 1)],
                                                   "each": {str: [bool]}, "any": object}, further=False)


@pytest.fixture(scope="module")
def reference() -> ModuleType:
    spec = importlib.util.spec_from_file_location("reference", ROOT / "docs" / "reference.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_key_of_a_scene_has_a_meaning(reference: ModuleType) -> None:
    page = reference.scene_keys()
    rows = [line.strip("| ").split(" | ") for line in page.splitlines() if line.startswith("| `")]
    assert [row for row in rows if len(row) != 3 or not row[2]] == []
    keys = {row[0].strip("`") for row in rows}
    read = set(re.findall(r'"(\w+)" (?:not )?in electrodes',
                          (ROOT / "eitsim" / "scene" / "scene_files.py").read_text(encoding="utf-8")))
    assert {"grid", "pitch_mm", "places"} <= read
    assert {*read, "calibrated"} <= keys
    assert "`card`" in page


def test_tables_are_introduced_by_whole_sentences_without_errors(reference: ModuleType) -> None:
    page = reference.scene_keys()
    for words in re.findall(r"^## \[\w+\]\n\n(.*)$", page, flags=re.MULTILINE):
        assert words.endswith(".")
        assert "Error" not in words


def test_files_are_named_as_they_are_written(reference: ModuleType, tmp_path: Path) -> None:
    page = reference.schemas(tmp_path)
    assert f"`{MANIFEST}` of a data set" in page
    assert f"`{store.DESCRIPTION}` of a model of a recording" in page
    for name in reference.SCHEMAS:
        assert (tmp_path / f"{name}.schema.json").is_file()


def test_examples_of_commands_are_code_whose_dashes_stay(reference: ModuleType) -> None:
    assert "Example: `matcal fit data_raw/uniaxial.csv data_raw/shear.csv --out card.json`" in reference.commands()
    assert "\nsmartquotes = False" in (ROOT / "docs" / "conf.py").read_text(encoding="utf-8")


def test_fields_of_exported_classes_are_explained_in_words(reference: ModuleType) -> None:
    page = reference.api("eitsim")
    assert "| `signal` | requested relative error of the touch signal" in page
    assert "| `friction` | one of `none`, `stick`, `coulomb` |" in page
    for name in reference.COMMANDS:
        assert re.findall(r"^\| `\w+` \| .*\b(?:one|some) of [\w.]*[A-Z_]{3,}\b", reference.api(name),
                          flags=re.MULTILINE) == []


def test_the_scene_on_the_page_of_keys_is_read(reference: ModuleType, tmp_path: Path) -> None:
    (block,) = re.findall(r"```toml\n(.*?)```", reference.scene_keys(), flags=re.DOTALL)
    (tmp_path / "scene.toml").write_text(block, encoding="utf-8")
    scene = eitsim.read_scene(tmp_path / "scene.toml")
    assert (scene.card, scene.punches[0].x_m, scene.electrodes.count) == ("card.json", 0.02, 16)


@pytest.mark.parametrize("document", [
    {"count": 3}, {"count": 3, "name": None, "pair": [7, 0.5], "each": {"a": [True]}, "any": [1, "x"]},
    {}, {"count": -1}, {"count": 2.5}, {"count": 3, "name": 4}, {"count": 3, "pair": [1]}, {"count": 3, "pair": [1, 2]},
    {"count": 3, "each": {"a": [1]}}, {"count": 3, "other": 1}, {"count": True}, []])
def test_a_shape_and_its_schema_say_the_same(reference: ModuleType, document: Any) -> None:
    try:
        check(document, SHAPE if isinstance(document, dict) else dict)
        sound = isinstance(document, dict)
    except ValueError:
        sound = False
    assert jsonschema.Draft202012Validator(reference.part_of(SHAPE)).is_valid(document) == sound


def test_a_card_fits_its_schema_and_a_broken_one_does_not(reference: ModuleType) -> None:
    card = matcal.MaterialCard("foam", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                               conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))
    document, validator = card_module.as_json(card), jsonschema.Draft202012Validator(
        reference.schema(card_module._SHAPE, "a material card"))
    validator.check_schema(validator.schema)
    assert [error.message for error in validator.iter_errors(document)] == []
    document["hyperfoam"]["nu"] = [0.7]
    assert not validator.is_valid(document)
