"""Fields next to the rows of a sweep: the same however it was stopped or grown, fixed by the design; damage named."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from eitsim.electrics.forward.gridded_fields import inside, values
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.sweeps.dataset import parquet
from eitsim.sweeps.dataset.hdf5_fields import SUFFIX
from eitsim.sweeps.design.design import design_from, representative_scene
from eitsim.sweeps.run import sweep as sweeps
from matcal.card import MaterialCard, write_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.errors import InputFileError

pytestmark = pytest.mark.usefixtures("solved_once")
FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm")
LAW = Conductivity(30.0, [-2, 2, -1], (0, 0.4))
STORED = {"names": ["strain", "pressure"], "side": 40}
RAW = {"seed": 13, "punch": {"x_mm": {"choice": [-20.0, 10.0, 101.0]}, "y_mm": 0.0, "diameter_mm": 14,
                            "force_N": [0.2, 0.4]}, "accuracy": {"signal": 0.05}, "fields": STORED}


@pytest.fixture
def card(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(sweeps, "ROWS_AFRESH", 2)
    write_card(MaterialCard("Table 1", FOAM, None, LAW), tmp_path / "card.json")
    return tmp_path / "card.json"


def swept(card: Path, folder: Path, scenes: int, **changed: Any) -> None:
    sweeps.sweep(design_from(RAW | changed, scenes), card, folder)


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.glob(f"part-*{SUFFIX}"))}


def stored(folder: Path, name: str) -> np.ndarray:
    """What the files of a set hold, one after the other."""
    return np.concatenate([h5py.File(path)[name][:] for path in sorted(folder.glob(f"part-*{SUFFIX}"))])


def test_every_row_has_the_fields_of_its_touch(card: Path, tmp_path: Path) -> None:
    swept(card, tmp_path / "a", 4)
    table = parquet.read_dataset(tmp_path / "a").table
    assert stored(tmp_path / "a", "scene").tolist() == [0, 1, 2, 3]
    assert len(files(tmp_path / "a")) == len(parquet.parts(tmp_path / "a")) == 2
    solved = table["outcome"].to_numpy() == "ok"
    assert 0 < solved.sum() < 4
    strain, pressure = (stored(tmp_path / "a", name) for name in ("driving_strain", "contact_pressure_kPa"))
    with h5py.File(tmp_path / "a" / next(iter(files(tmp_path / "a")))) as file:
        y, x, on_skin = (file[name][:] for name in ("y_mm", "x_mm", "inside"))
    assert np.array_equal(np.isfinite(strain), solved[:, None, None] & on_skin)
    y, x = np.meshgrid(y, x, indexing="ij")
    under = np.nan_to_num(pressure).reshape(4, -1).argmax(axis=1)
    apart = np.hypot(x.ravel()[under] - table["x_mm"], y.ravel()[under] - table["y_mm"])
    assert (apart[solved] < 7 + 5).all()


def test_stored_values_are_those_of_the_solved_touch(card: Path, tmp_path: Path) -> None:
    swept(card, tmp_path / "a", 1, punch={"x_mm": 10.0, "y_mm": 0.0, "diameter_mm": 14, "force_N": 0.3})
    design = design_from(RAW | {"punch": {"x_mm": 10.0, "y_mm": 0.0, "diameter_mm": 14, "force_N": 0.3}}, 1)
    scene = representative_scene(design)
    assert design.fields is not None
    touch = solve_touch(FOAM, scene.body, scene.punches[0])
    expected, there = values(design.fields, scene, [touch], LAW), inside(design.fields, scene.body)
    (found,) = stored(tmp_path / "a", "driving_strain")
    assert found[there] == pytest.approx(expected["strain"][there], abs=2e-3)
    assert expected["strain"][there].max() > 0.05


def test_a_grown_or_mended_sweep_has_the_files_of_one_in_a_go(card: Path, tmp_path: Path) -> None:
    swept(card, tmp_path / "whole", 4)
    swept(card, tmp_path / "grown", 1)
    swept(card, tmp_path / "grown", 4)
    assert files(tmp_path / "grown") == files(tmp_path / "whole")
    part = parquet.parts(tmp_path / "grown")[0]
    part.with_suffix(SUFFIX).write_bytes(b"stopped between both files")
    part.unlink()
    swept(card, tmp_path / "grown", 4)
    assert files(tmp_path / "grown") == files(tmp_path / "whole")


def test_fields_are_fixed_by_the_design(card: Path, tmp_path: Path) -> None:
    swept(card, tmp_path / "a", 1)
    with pytest.raises(ValueError, match=r"made with another design: its side in \[fields\] is"):
        swept(card, tmp_path / "a", 2, fields={**STORED, "side": 41})
    swept(card, tmp_path / "none", 1, fields={"names": ["strain"], "side": 4})
    with pytest.raises(ValueError, match=r"radius_mm in \[body\] is drawn"):
        design_from(RAW | {"body": {"radius_mm": [90, 100]}}, 3)


def test_without_the_table_nothing_is_stored(card: Path, tmp_path: Path) -> None:
    plain = {key: value for key, value in RAW.items() if key != "fields"}
    sweeps.sweep(design_from(plain, 2), card, tmp_path / "a")
    assert files(tmp_path / "a") == {}
    swept(card, tmp_path / "b", 2)
    a, b = (parquet.read_dataset(tmp_path / name).table.drop(columns=list(parquet.COST)) for name in "ab")
    assert a.equals(b)


def test_damage_is_named_with_the_mend(card: Path, tmp_path: Path) -> None:
    swept(card, tmp_path / "a", 1)
    ((first, content),) = files(tmp_path / "a").items()
    path = tmp_path / "a" / first
    for damage in (content[:len(content) // 2], b"", b"no HDF5"):
        path.write_bytes(damage)
        with pytest.raises(InputFileError, match=rf"{path.stem}.parquet next to it and continue the sweep"):
            swept(card, tmp_path / "a", 2)
    path.unlink()
    with pytest.raises(InputFileError, match="it is missing"):
        swept(card, tmp_path / "a", 2)
    swept(card, tmp_path / "b", 2)
    parquet.parts(tmp_path / "a")[0].unlink()
    swept(card, tmp_path / "a", 2)
    assert files(tmp_path / "a") == files(tmp_path / "b")
