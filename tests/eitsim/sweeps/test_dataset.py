"""Data sets on disk: parts are whole or absent, rows come back sorted, damage is named."""

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.dataset
import pyarrow.parquet as pq
import pytest

from eitsim.scene.drive import voltage_columns
from eitsim.sweeps.dataset.parquet import (
    FIXED,
    RELAXATION,
    decoded,
    encoded,
    read_dataset,
    read_manifest,
    read_part,
    with_rows,
    write_manifest,
    write_part,
)
from eitsim.sweeps.design.card_draws import Cards
from eitsim.sweeps.design.design import design_from
from eitsim.sweeps.run.folder import start_or_continue
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from touchcal.errors import InputFileError


def row(scene: int, outcome: str = "ok") -> dict[str, object]:
    return dict.fromkeys(FIXED, 0.5) | {"scene": scene, "outcome": outcome} | dict.fromkeys(voltage_columns(4), 1.0)


def test_rows_come_back_sorted_and_filtered(tmp_path: Path) -> None:
    write_manifest(tmp_path, {"design": {"scenes": 4, "seed": 1, "tables": {}}, "card": {}})
    write_part(tmp_path, [row(3), row(2, "refused")])
    write_part(tmp_path, [row(0), row(1)])
    data = read_dataset(tmp_path)
    assert data.table["scene"].tolist() == [0, 1, 2, 3]
    assert data.ok["scene"].tolist() == [0, 1, 3]
    assert not [p for p in tmp_path.iterdir() if p.name.endswith(".tmp")]


def test_rows_take_the_place_of_those_of_the_same_scenes(tmp_path: Path) -> None:
    old = encoded(pd.DataFrame([row(0), row(1, "crashed"), row(2), row(5)]))
    found = decoded(with_rows(old, encoded(pd.DataFrame([row(1), row(2, "refused"), row(3)]))))
    assert found["scene"].tolist() == [0, 1, 2, 3, 5]
    assert found["outcome"].tolist() == ["ok", "ok", "refused", "ok", "ok"]


def test_a_failed_write_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(KeyError):
        write_part(tmp_path, [{"outcome": "ok"}])
    with pytest.raises(Exception, match=r"(?i)convert|serialize|object"):
        write_part(tmp_path, [row(0) | {"x_mm": object()}])
    assert list(tmp_path.iterdir()) == []


def test_damage_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="not a data set"):
        read_dataset(tmp_path)
    write_manifest(tmp_path, {"design": {"scenes": 4, "tables": {}}, "card": {}})
    with pytest.raises(InputFileError, match="no rows"):
        read_dataset(tmp_path)
    write_part(tmp_path, [row(0), row(1)])
    write_part(tmp_path, [row(1)])
    with pytest.raises(InputFileError, match="scene 1 stands in it twice"):
        read_dataset(tmp_path)


def part_of(tmp_path: Path, table: pd.DataFrame, stamped: bool = True) -> Path:
    path = tmp_path / "part-000000000.parquet"
    if stamped:
        path.write_bytes(encoded(table))
    else:
        table.to_parquet(path, index=False)
    return path


def test_a_part_of_before_hashes_is_read(tmp_path: Path) -> None:
    table = pd.DataFrame([row(0), row(1, "refused")])
    write_manifest(tmp_path, {"design": {"scenes": 2, "tables": {}}, "card": {}})
    part_of(tmp_path, table, stamped=False)
    assert read_dataset(tmp_path).table.equals(table)


def test_every_flipped_byte_of_a_part_is_noticed(tmp_path: Path) -> None:
    path = part_of(tmp_path, pd.DataFrame([row(0), row(1)]))
    content, whole = path.read_bytes(), read_part(path)
    for at in range(0, len(content), 41):
        path.write_bytes(content[:at] + bytes([content[at] ^ 1]) + content[at + 1:])
        try:
            found = read_part(path)
        except InputFileError:
            continue
        pd.testing.assert_frame_equal(found, whole)  # a byte that means nothing for the rows


def test_rows_that_were_changed_under_the_old_hash_are_noticed(tmp_path: Path) -> None:
    path = part_of(tmp_path, pd.DataFrame([row(0), row(1)]))
    file = pq.ParquetFile(path)
    stamp, table = file.metadata.metadata, file.read()
    changed = table.set_column(table.column_names.index("F_N"), "F_N", pa.array([0.5, 0.6])).replace_schema_metadata()
    with pq.ParquetWriter(path, changed.schema) as writer:
        writer.write_table(changed)
        writer.add_key_value_metadata(stamp)
    with pytest.raises(InputFileError, match="its rows are not those that were written"):
        read_part(path)


@pytest.mark.parametrize(("change", "said"), [
    (lambda table: table.iloc[:0], "it holds no rows"),
    (lambda table: table.drop(columns="outcome"), "not every row has its outcome"),
    (lambda table: table.drop(columns="scene"), "not every row has its scene"),
    (lambda table: table.assign(v_000=np.nan, dv_000=1.0), "v_000 of scene 0 is missing")])
def test_a_part_without_what_every_part_has_is_named(tmp_path: Path, change, said: str) -> None:
    path = part_of(tmp_path, change(pd.DataFrame([row(0), row(1)])), stamped=False)
    with pytest.raises(InputFileError, match=rf"part-000000000\.parquet: .*{said}"):
        read_part(path)


@pytest.mark.parametrize("name", ["part-zzz.parquet", "part-000000007.parquet"])
def test_a_part_of_another_name_or_of_scenes_outside_the_design_is_named(tmp_path: Path, name: str) -> None:
    write_manifest(tmp_path, {"design": {"scenes": 2, "tables": {}}, "card": {}})
    (tmp_path / name).write_bytes(encoded(pd.DataFrame([row(0 if "z" in name else 7)])))
    with pytest.raises(InputFileError, match="does not belong"):
        read_dataset(tmp_path)


def test_the_folder_opens_as_it_is(tmp_path: Path) -> None:
    write_manifest(tmp_path, {"design": {"scenes": 4, "tables": {}}, "card": {}})
    write_part(tmp_path, [row(0), row(1, "refused")])
    write_part(tmp_path, [row(2), row(3)])
    (tmp_path / ".lock").touch()
    whole = read_dataset(tmp_path).table
    assert pd.read_parquet(sorted(tmp_path.glob("*.parquet"))).sort_values("scene", ignore_index=True).equals(whole)
    found = pyarrow.dataset.dataset(sorted(map(str, tmp_path.glob("*.parquet"))))
    assert found.to_table(filter=pyarrow.dataset.field("outcome") == "ok")["scene"].to_pylist() == [0, 2, 3]
    dask = pytest.importorskip("dask.dataframe")
    assert dask.read_parquet(str(tmp_path / "*.parquet"))["x_mm"].sum().compute() == whole["x_mm"].sum()


def test_parts_cost_little_beside_their_numbers(tmp_path: Path) -> None:
    rows = [row(i) | {name: 0.1 * i + j for j, name in enumerate(voltage_columns(416))} for i in range(64)]
    write_part(tmp_path, rows)
    (part,) = tmp_path.glob("*.parquet")
    assert part.stat().st_size < 1.4 * 64 * 8 * len(rows[0])


@pytest.mark.parametrize(("hold", "told"), [({}, "longterm"), ({"moduli": "instantaneous"}, "instantaneous"),
                                            ({"time_s": [1.0]}, None)])
def test_the_manifest_holds_the_foams_relaxation_unless_touches_are_held(tmp_path: Path, hold: dict[str, object],
                                                                         told: str | None) -> None:
    card = MaterialCard("foam", Hyperfoam([14420.0], [4.249], [0.0], "longterm"), Prony([0.2, 0.1], [1.0, 30.0]),
                        Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
    design = design_from({"punch": {"x_mm": 0, "y_mm": 0, "diameter_mm": 14, "force_N": 0.27},
                          **({"hold": hold} if hold else {})}, 1)
    start_or_continue(tmp_path, design, Cards(card), {}, 10, None, (), False)
    found = read_manifest(tmp_path).get(RELAXATION)
    assert found == (None if told is None else {"g": [0.2, 0.1], "tau_s": [1.0, 30.0], "moduli": told})
