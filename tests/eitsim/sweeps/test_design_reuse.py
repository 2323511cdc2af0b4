"""Which table of load paths serves a design: diameters from lists, laws with ends and tables of scenes; examples."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from eitsim.electrics.forward.gridded_fields import fields_from
from eitsim.sweeps.design.design import Design, design_from, read_design, valid_scenes
from eitsim.sweeps.run.load_path_choice import design_shape, repays
from eitsim.sweeps.run.scene_table import read_scene_table
from eitsim.sweeps.run.sweep import Progress, sweep
from matcal.card import MaterialCard, write_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.errors import NotConverged

CARD = MaterialCard("Table 1", Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm"),
                    None, Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
EXAMPLES = Path(__file__).parents[3] / "examples"


class _Ended(Exception):
    """Ends a sweep from its progress."""


def begun(design: Design, place: Path, steps: int = 1, **options: Any) -> None:
    """Sweep as far as this number of steps."""
    seen = []

    def end(step: Progress) -> None:
        seen.append(step)
        if len(seen) == steps:
            raise _Ended

    with pytest.raises(_Ended):
        sweep(design, place / "card.json", place / "out", progress=end, **options)


@pytest.mark.parametrize(("diameter", "diameters", "spans"), [
    ({"list": [18, 10, 14]}, (1.0, 1.4, 1.8), False), ({"dist": "integer", "lo": 10, "hi": 18}, (1.0, 1.8), True),
    ({"dist": "normal", "mean": 14, "sd": 2, "lo": 12, "hi": 17}, (1.2, 1.7), True)])
def test_diameters_with_ends_have_a_table(diameter: Any, diameters: tuple[float, ...], spans: bool) -> None:
    raw = {"touches": [1, 3], "punch": {"place": {"gap_mm": 30, "apart_mm": 30}, "diameter_mm": diameter,
                                        "force_N": {"dist": "loguniform", "lo": 0.1, "hi": 2}}}
    shape = design_shape(design_from(raw, 300), CARD)
    assert (shape.diameters, shape.spans) == (diameters, spans)


def test_a_table_of_scenes_has_a_table_of_load_paths(tmp_path: Path) -> None:
    cells = "\n".join(f"{10 + 4 * (i % 2)},{0.1 + 0.01 * i}" for i in range(130))
    (tmp_path / "scenes.csv").write_text(f"d_mm,F_N\n{cells}\n")
    design = read_scene_table(tmp_path / "scenes.csv")
    shape = design_shape(design, CARD)
    assert (shape.diameters, shape.spans) == ((1.0, 1.4), False)
    assert repays(design, shape)


def test_rows_added_to_a_table_of_scenes_change_no_load_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nine diameters have a path each; with a tenth the design alone would ask for a range of them."""
    cells = [f"{d},{force}" for d in range(10, 19) for force in (0.2, 0.3)]
    (tmp_path / "scenes.csv").write_text("\n".join(["d_mm,F_N", *cells]) + "\n")
    write_card(CARD, tmp_path / "card.json")
    few = read_scene_table(tmp_path / "scenes.csv")
    begun(few, tmp_path, reuse=True)
    (tmp_path / "scenes.csv").write_text("\n".join(["d_mm,F_N", *cells, "30,0.3"]) + "\n")
    more, asked = read_scene_table(tmp_path / "scenes.csv"), []

    def recorded(shape, run, *, rim: bool = False):
        asked.append(shape)
        raise NotConverged("none is made here")

    monkeypatch.setattr("eitsim.sweeps.run.load_path_choice.table_for", recorded)
    begun(more, tmp_path, steps=2)
    assert design_shape(more, CARD).spans
    assert asked == [design_shape(few, CARD)]


@pytest.mark.parametrize(("change", "named"), [
    ({"seed": 5}, "its seed is 0, here 5"), ({"fields": fields_from({"names": ["strain"]})}, "its fields is not given"),
    ({"tables": {"punch": [{"diameter_mm": {"rows": [12, 14]}, "force_N": {"rows": [0.2, 0.4]}}]}},
     "rows or columns that stood in it are changed")])
def test_what_differs_of_a_table_of_scenes_is_named(change: dict[str, Any], named: str, tmp_path: Path) -> None:
    (tmp_path / "scenes.csv").write_text("d_mm,F_N\n12,0.2\n14,0.3\n")
    write_card(CARD, tmp_path / "card.json")
    design = read_scene_table(tmp_path / "scenes.csv")
    begun(design, tmp_path)
    with pytest.raises(ValueError, match=named):
        sweep(replace(design, **change), tmp_path / "card.json", tmp_path / "out")


def test_drawn_profiles_are_solved_directly() -> None:
    with pytest.raises(ValueError, match=r"profile in \[punch\] is drawn"):
        design_shape(design_from({"punch": {"profile": {"choice": ["flat", "cone"]}}}, 10), CARD)


@pytest.mark.parametrize("name", ["design", "paper", "calibration", "uncertain"])
def test_examples_are_designs_whose_scenes_are_right(name: str) -> None:
    design = read_design(EXAMPLES / f"{name}.toml")
    assert sum(1 for _ in valid_scenes(design, 300)) == min(design.scenes, 300)
