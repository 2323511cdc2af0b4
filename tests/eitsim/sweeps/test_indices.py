"""Indices of nested data sets: rows share touches and cards, known truths come back, what cannot be told is refused."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from eitsim.cli.main import app
from eitsim.scene.drive import voltage_columns
from eitsim.sweeps.dataset.parquet import FIXED, read_dataset, write_manifest, write_part
from eitsim.sweeps.design.card_draws import Cards, Material, cards_for, count_in_use, draw_of
from eitsim.sweeps.design.design import card_number, design_from, scene_at
from eitsim.sweeps.measurement.instrument import Measurement
from eitsim.sweeps.run.sweep import sweep
from eitsim.sweeps.sobol.sobol_indices import indices_of, read_blocks
from matcal.card import MaterialCard, read_card, write_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.posterior.draws import Draws, write_draws
from touchcal.errors import InputFileError

RAW = {"seed": 7, "sampler": "nested", "punch": {"x_mm": [-25, 25], "y_mm": [-25, 25], "diameter_mm": 14,
                                                 "force_N": [0.15, 0.3]},
       "accuracy": {"signal": 0.05}, "material": {"draws": 6, "parts": ["conductivity"]}}
READINGS = 16 * 13


@pytest.fixture(scope="module")
def card(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cards")
    skin = np.linspace(28, 33, 6)[:, None] * np.array([1.0, -2, 2, -1])
    write_draws(Draws({}, conductivity_S_per_m=skin), folder / "posterior.nc", {})
    foam = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm")
    write_card(MaterialCard("drawn", foam, None, Conductivity(30.0, [-2, 2, -1], (0, 0.4)),
                            posterior={"file": "posterior.nc", "n": 6}), folder / "card.json")
    return folder / "card.json"


def made(folder: Path, blocks: int, *, failed: tuple[int, ...] = (), lost: tuple[int, ...] = (), readings: int = 9,
         **design) -> Path:
    """A data set whose depth is 3 t + m, largest pressure t m, area constant, and first reading t + m / 2, for
    standard normal touches t and cards m; the other readings are the first one times a number of their own."""
    folder.mkdir()
    write_manifest(folder, {"design": {"scenes": 4 * blocks, "seed": 1, "sampler": "nested", "tables": {}, **design},
                            "card": {}})
    rng = np.random.default_rng(5)
    t, m = (np.broadcast_to(z, (blocks, 2, 2)).ravel() for z in
            (rng.standard_normal((blocks, 2, 1)), rng.standard_normal((blocks, 1, 2))))
    weight = np.linspace(1, 2, readings)
    rows = []
    for i in range(4 * blocks):
        if i in lost:
            continue
        dv = 1e-3 * (t[i] + m[i] / 2) * weight
        rows.append(dict.fromkeys(FIXED, 0.5) | {
            "scene": i, "card_sample": 2 * (i // 4) + i % 2, "outcome": "refused" if i in failed else "ok",
            "delta_max_mm": 5 + 3 * t[i] + m[i],
            "sigma_max_kPa": t[i] * m[i], "sigma_ave_kPa": t[i], "A_c_mm2": 154.0, "F_N": t[i]}
            | dict(zip(voltage_columns(readings), (1 + dv).tolist(), strict=True))
            | dict(zip(voltage_columns(readings, "dv"), dv.tolist(), strict=True)))
    write_part(folder, rows)
    return folder


def share(found, name: str, kind: str = "first") -> list[float]:
    return getattr(found.shares, kind)[:, found.names.index(name)].tolist()


def test_rows_of_a_block_share_touches_and_cards() -> None:
    design = design_from(RAW, 16)
    scenes = [scene_at(design, i).punches[0] for i in range(16)]
    numbers = [card_number(design, i) for i in range(16)]
    for block in range(4):
        a, b, c, d = range(4 * block, 4 * block + 4)
        assert scenes[a] == scenes[b] != scenes[c] == scenes[d]
        assert numbers[a] == numbers[c] == numbers[b] - 1 == numbers[d] - 1
    assert len(set(scenes)) == len(set(numbers)) == 8
    longer = design_from(RAW, 400)
    assert [scene_at(longer, i).punches[0] for i in range(16)] == scenes


def test_the_cards_of_a_block_differ(card: Path) -> None:
    made_of = cards_for(design_from(RAW, 4).material, 7, read_card(card))
    pairs = [{draw_of(made_of, 2 * b), draw_of(made_of, 2 * b + 1)} for b in range(60)]
    assert {len(pair) for pair in pairs} == {2}
    assert len({tuple(sorted(pair)) for pair in pairs}) == 15


@pytest.mark.parametrize("draws", [2, 3, 5, 6])
def test_the_cards_of_a_block_differ_whatever_their_number(card: Path, draws: int) -> None:
    """Of an odd number one sits out of each cycle, so that no pair is parted by its end; all serve in the long run."""
    alone, paired = (cards_for(Material(draws), 7, read_card(card), in_pairs=pairs) for pairs in (False, True))
    met = np.array([draw_of(paired, number) for number in range(400)]).reshape(-1, 2)
    assert (met[:, 0] != met[:, 1]).all()
    assert set(met.ravel().tolist()) == set(range(draws))
    assert count_in_use(paired, 400) == draws
    if draws % 2 == 0:
        assert met.ravel().tolist() == [draw_of(alone, number) for number in range(400)]


@pytest.mark.parametrize(("change", "named"), [
    ({"scenes": 10}, "Give 12"), ({"material": {"posterior": False}}, "all rows have one card"),
    ({"punch": {"force_N": {"list": [0.2, 0.3]}}}, "goes through a list"),
    ({"material": {"rows_per_draw": 2}}, "leave rows_per_draw out"), ({"material": {"draws": 1}}, "2 draws or more")])
def test_designs_without_a_nest_are_refused(change: dict, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        design_from(RAW | {"scenes": 8} | change)


def test_known_shares_come_back(tmp_path: Path) -> None:
    """Limits of the product t m are four standard errors, 1.73 of a share over the root of the number of blocks."""
    blocks = read_blocks(made(tmp_path / "a", 4000))
    found = indices_of(blocks)
    assert found.factors == ("touch", "material")
    assert share(found, "delta_max_mm") == pytest.approx([0.9, 0.1], abs=0.01)
    assert share(found, "sigma_max_kPa") == pytest.approx([0, 0], abs=4 * 1.73 / np.sqrt(4000))
    assert share(found, "sigma_max_kPa", "total") == pytest.approx([1, 1], abs=4 * 1.73 / np.sqrt(4000))
    assert share(found, "sigma_ave_kPa") == pytest.approx([1, 0], abs=1e-12)
    assert np.isnan(share(found, "A_c_mm2")).all()
    for name in ("dv_000", "dv_008", "v_004", "dv"):
        assert share(found, name) == pytest.approx([0.8, 0.2], abs=0.02)
        assert share(found, name, "total") == pytest.approx(share(found, name), abs=1e-9)
    assert found.shares.spread[1, found.names.index("delta_max_mm")] == pytest.approx(1.0, rel=0.05)


def test_the_spread_by_the_card_within_a_range_of_touches(tmp_path: Path) -> None:
    """At a touch t the pressure t m spreads by |t|: among touches of 1.9 to 2.1 by 2."""
    blocks = read_blocks(made(tmp_path / "a", 4000))
    found = indices_of(blocks, within={"F_N": (1.9, 2.1)})
    assert found.within is not None
    assert found.within[found.names.index("sigma_max_kPa")] == pytest.approx(2.0, rel=4 / np.sqrt(2 * found.touches))
    assert found.within[found.names.index("dv")] == pytest.approx(
        0.5e-3 * np.sqrt(np.mean(np.linspace(1, 2, 9)**2)), rel=4 / np.sqrt(2 * found.touches))
    with pytest.raises(ValueError, match="'force' is no key"):
        indices_of(blocks, within={"force": (0, 1)})
    with pytest.raises(ValueError, match="give a range of F_N"):
        indices_of(blocks, within={"delta_max_mm": (0, 1)})
    with pytest.raises(ValueError, match="no touch lies within"):
        indices_of(blocks, within={"F_N": (90, 91)})


def test_noise_is_a_factor_of_the_readings_alone(tmp_path: Path) -> None:
    folder = made(tmp_path / "a", 400, readings=READINGS, measurement={"noise_V": 1e-3, "clean_baseline": True})
    found = indices_of(read_blocks(folder))
    assert found.factors == ("touch", "material", "noise")
    assert share(found, "dv_000") == pytest.approx([1 / 2.25, 0.25 / 2.25, 1 / 2.25], abs=0.07)
    assert share(found, "delta_max_mm")[2] == 0.0
    assert found.shares.spread[2, found.names.index("dv_007")] == pytest.approx(1e-3, rel=0.1)
    louder = indices_of(read_blocks(folder, Measurement(noise_V=1e-2, clean_baseline=True)))
    assert share(louder, "dv")[2] > 0.95


def test_blocks_that_are_not_whole_are_dropped_and_counted(tmp_path: Path) -> None:
    blocks = read_blocks(made(tmp_path / "a", 20, failed=(5, 6, 41), lost=(78, 79)))
    assert (len(blocks.values), blocks.failed, blocks.unfinished) == (17, 2, 1)
    whole = read_blocks(made(tmp_path / "b", 20))
    kept = [i for i in range(20) if i not in (1, 10, 19)]
    assert np.array_equal(blocks.values, whole.values[kept])
    with pytest.raises(InputFileError, match="no block of 4 rows is ok"):
        read_blocks(made(tmp_path / "c", 1, failed=(2,)))


def test_every_touch_that_all_rows_have_is_an_output(tmp_path: Path) -> None:
    folder = made(tmp_path / "a", 5)
    table = read_dataset(folder).table
    for name in ("sigma_max_kPa", "sigma_ave_kPa", "A_c_mm2", "delta_max_mm"):
        stem, unit = name.rsplit("_", 1)
        table[f"{stem}_2_{unit}"] = 2 * table[name]
        table[f"{stem}_3_{unit}"] = np.nan
    write_part(folder, table.assign(touches=np.where(table["scene"] % 4 < 2, 2, 3)).to_dict("records"))
    found = indices_of(read_blocks(folder))
    assert share(found, "delta_max_2_mm") == share(found, "delta_max_mm")
    assert "delta_max_3_mm" not in found.names


def test_other_data_sets_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=r"sampler = \"nested\" and a table \[material\]"):
        read_blocks(made(tmp_path / "a", 3, sampler="random"))
    measured = made(tmp_path / "b", 3)
    manifest = json.loads((measured / "design.json").read_text())
    write_manifest(measured, manifest | {"clean": {}})
    with pytest.raises(InputFileError, match="Give the clean set"):
        read_blocks(measured)


@pytest.mark.thorough
def test_a_nested_sweep_grows_and_its_command_tells_all_readings(card: Path, tmp_path: Path) -> None:
    """Only the skin is drawn: the mechanics of a touch are the same with both cards, bit for bit."""
    for scenes in (4, 8):
        last = sweep(design_from(RAW, scenes), card, tmp_path / "a").account
        assert last is not None
        assert (last.solved, last.kept) == (4, scenes - 4)
    table = read_dataset(tmp_path / "a").table
    assert table["delta_max_mm"].to_numpy()[::2].tolist() == table["delta_max_mm"].to_numpy()[1::2].tolist()
    made_of = CliRunner().invoke(app, ["indices", str(tmp_path / "a"), "--out", str(tmp_path / "i.csv"), "--json"])
    told = json.loads(made_of.stdout)
    assert (told["blocks"], told["blocks_failed"]) == (2, 0)
    assert told["outputs"]["delta_max_mm"]["material_spread"] == 0.0
    assert told["outputs"]["A_c_mm2"]["unit"] == "mm2"
    assert told["outputs"]["dv"]["material_total"] > 0
    readings = pd.read_csv(tmp_path / "i.csv")
    assert set(voltage_columns(READINGS, "dv")) < set(readings["output"])
    assert {"touch_first", "material_total_lo", "material_spread"} < set(readings.columns)
    assert told["cards"] == table["card_sample"].nunique()
    shown = CliRunner().invoke(app, ["indices", str(tmp_path / "a"), "--within", "F_N=0,1"])
    assert f"drawn again, from {told['cards']} cards. So few" in " ".join(shown.stdout.split())
    assert "Knowing the card would take" in shown.stdout
    refused = CliRunner().invoke(app, ["indices", str(tmp_path / "a"), "--within", "F_N=2"])
    assert isinstance(refused.exception, ValueError)


def test_a_design_without_material_has_one_card() -> None:
    assert draw_of(Cards(MaterialCard("bare")), 3) == -1
