"""Cards of a sweep: whole parameter sets of the posterior, chosen by seed and number, recorded, told apart."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from eitsim.mechanics.load_paths import build_table
from eitsim.scene.choices import Kind
from eitsim.scene.drive import voltage_columns
from eitsim.simulation import reuse
from eitsim.simulation.simulate import simulate
from eitsim.sweeps.dataset.parquet import COST, read_dataset, read_manifest
from eitsim.sweeps.dataset.sweep_record import Account
from eitsim.sweeps.design.card_draws import (
    Cards,
    Material,
    card_at,
    cards_for,
    columns,
    draw_of,
    material_from,
    recorded,
)
from eitsim.sweeps.design.design import card_number, design_from, scene_at
from eitsim.sweeps.run.account import account_of
from eitsim.sweeps.run.omissions import omissions
from eitsim.sweeps.run.rows import solve_rows
from eitsim.sweeps.run.sweep import sweep
from matcal.card import MaterialCard, read_card, write_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from matcal.posterior.draws import Draws, foam_draws, read_draws, write_draws

COUNT = 40
MU, ALPHA = np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741])
RAW = {"seed": 7, "punch": {"x_mm": [-25, 25], "y_mm": [-25, 25], "diameter_mm": 14, "force_N": [0.15, 0.3]},
       "accuracy": {"signal": 0.05}, "material": {"draws": 5}}
PARAMETERS = ["mu_1_Pa", "mu_2_Pa", "mu_3_Pa", "alpha_1", "alpha_2", "alpha_3", "nu_1", "nu_2", "nu_3", "g_1",
              "tau_1_s", "c0_S_per_m", "a_1", "a_2", "a_3"]


def posterior(omega: float = 0.0) -> Draws:
    """Draws about a law whose parameters vary together."""
    z = np.random.default_rng(3).standard_normal((COUNT, 3))
    skin = 30 * np.exp(0.05 * z[:, 2:]) * np.array([1.0, -2, 2, -1])
    return foam_draws(MU * np.exp(0.1 * z[:, :1]), np.tile(ALPHA, (COUNT, 1)), np.zeros((COUNT, 3)),
                      g=0.2 + 0.02 * z[:, 1:2], tau_s=np.full((COUNT, 1), 9.0), conductivity_S_per_m=skin,
                      omega=np.full(COUNT, omega) if omega else None)


@pytest.fixture(scope="module")
def card(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("cards"), posterior(0.1))


def written(folder: Path, draws: Draws, **changes) -> Path:
    (folder / "card.d").mkdir()
    write_draws(draws, folder / "card.d" / "posterior.nc", {})
    whole = MaterialCard("drawn", Hyperfoam(MU, ALPHA, np.zeros(3), "longterm"), Prony([0.2], [9.0]),
                         Conductivity(30.0, [-2, 2, -1], (0, 0.4)),
                         posterior={"file": "card.d/posterior.nc", "n": COUNT})
    write_card(replace(whole, **changes), folder / "card.json")
    return folder / "card.json"


def cards(card: Path, seed: int = 7, **table) -> Cards:
    return cards_for(material_from(table), seed, read_card(card))


def account(card: Path, folder: Path, scenes: int, raw: dict = RAW, workers: int = 1) -> Account:
    last = sweep(design_from(raw, scenes), card, folder, workers=workers).account
    assert last is not None
    return last


def test_every_cycle_meets_each_card_once_in_another_order(card: Path) -> None:
    made = cards(card, draws=12, rows_per_draw=3)
    blocks = np.array([draw_of(made, i) for i in range(24 * 3)]).reshape(24, 3)
    assert (blocks == blocks[:, :1]).all()
    assert set(blocks[:12, 0]) == set(blocks[12:, 0]) == set(range(12))
    assert blocks[:12, 0].tolist() != blocks[12:, 0].tolist()
    assert Counter(draw_of(cards(card), i) for i in range(COUNT)).most_common(1)[0][1] == 1


def test_more_draws_keep_those_that_were_chosen_and_another_seed_chooses_others(card: Path) -> None:
    few, many = cards(card, draws=6), cards(card, draws=20)
    assert few.samples.tolist() == many.samples[:6].tolist()
    assert len(set(many.samples.tolist())) == 20
    assert few.samples.tolist() != cards(card, seed=8, draws=6).samples.tolist()


def test_a_card_is_one_whole_draw_and_recorded_as_used(card: Path) -> None:
    made, held = cards(card, draws=6, specimen=False), read_draws(card)
    assert columns(made) == PARAMETERS
    for number in range(6):
        row = recorded(made, number)
        k, used = int(row["card_sample"]), card_at(made, number)
        assert used.hyperfoam
        assert used.prony
        assert used.conductivity
        assert held.g is not None
        assert held.conductivity_S_per_m is not None
        assert used.hyperfoam.mu_Pa.tolist() == held.law["mu_Pa"][k].tolist() == [row[f"mu_{i}_Pa"] for i in (1, 2, 3)]
        assert used.prony.g[0] == row["g_1"] == held.g[k, 0]
        assert used.conductivity.c0_S_per_m == row["c0_S_per_m"] == held.conductivity_S_per_m[k, 0]
        assert used.conductivity.a.tolist() == [row[f"a_{i}"] for i in (1, 2, 3)]


def test_parts_that_do_not_vary_are_those_of_the_card(card: Path) -> None:
    made = cards(card, parts=["conductivity"])
    used, itself = card_at(made, 0), read_card(card)
    assert columns(made) == PARAMETERS[-4:]
    assert used.hyperfoam
    assert used.hyperfoam.mu_Pa.tolist() == MU.tolist()
    assert used.prony
    assert used.prony.g.tolist() == [0.2]
    assert used.conductivity != itself.conductivity


def test_specimens_scatter_as_replicates_do_and_keep_their_shape(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    n = 1000
    base = foam_draws(np.tile(MU, (n, 1)), np.tile(ALPHA, (n, 1)), np.zeros((n, 3)), omega=np.full(n, 0.15))
    made = cards_for(Material(specimen=True), int(rng.integers(99)), read_card(p := written(tmp_path, base)))
    assert made.draws is not None
    factor = made.draws.law["mu_Pa"] / MU
    assert np.allclose(factor, factor[:, :1], rtol=1e-12)
    assert np.log(factor[:, 0]).std() == pytest.approx(0.15, rel=4 / np.sqrt(2 * n))
    assert np.log(factor[:, 0]).mean() == pytest.approx(0.0, abs=4 * 0.15 / np.sqrt(n))
    again = cards_for(Material(draws=10, specimen=True), made.seed, read_card(p))
    assert again.draws is not None
    assert again.draws.law["mu_Pa"].tolist() == made.draws.law["mu_Pa"][:10].tolist()


def test_cards_are_of_further_specimens_where_scatter_is_known(card: Path, tmp_path: Path) -> None:
    own, asked, mean = cards(card), cards(card, specimen=True), cards(card, specimen=False)
    assert own.draws is not None
    assert asked.draws is not None
    assert own.draws.law["mu_Pa"].tolist() == asked.draws.law["mu_Pa"].tolist()
    assert (own.further, mean.further, cards(card, parts=["conductivity"]).further) == (True, False, None)
    alone = cards(written(tmp_path, posterior()))
    assert alone.further is None
    design, said = design_from(RAW, 3), {}
    for made in (own, mean, alone):
        (said[made.further],) = (o.reason for o in omissions(design, made, exact=False) if o.kind == Kind.DRAWN_CARDS)
    assert "a further specimen" in said[True]
    assert "the mean of the specimens tested" in said[False]
    assert "not in it" in said[None]


def test_draws_are_labelled_as_the_card(tmp_path: Path) -> None:
    """Moduli of draws are long-term; a card of instantaneous ones gets each draw's own over its g_infinity."""
    path = written(tmp_path, posterior(), law=Hyperfoam(MU / 0.8, ALPHA, np.zeros(3), "instantaneous"))
    made, held = cards(path), read_draws(path)
    row = recorded(made, 0)
    k = int(row["card_sample"])
    assert held.g is not None
    assert row["mu_1_Pa"] == pytest.approx(held.law["mu_Pa"][k, 0] / (1 - held.g[k, 0]), rel=1e-14)
    used = card_at(made, 0).hyperfoam
    assert used
    assert used.moduli == "instantaneous"


def test_rows_equal_a_run_with_a_card_made_of_their_draw(card: Path, tmp_path: Path) -> None:
    assert account(card, tmp_path / "a", 2).outcomes == {"ok": 2}
    table, design, itself = read_dataset(tmp_path / "a").table, design_from(RAW, 2), read_card(card)
    for row in table.to_dict("records"):
        write_card(replace(itself, law=Hyperfoam([row[f"mu_{i}_Pa"] for i in (1, 2, 3)], ALPHA, np.zeros(3)),
                           prony=Prony([row["g_1"]], [row["tau_1_s"]]),
                           conductivity=Conductivity(row["c0_S_per_m"], [row[f"a_{i}"] for i in (1, 2, 3)], (0, 0.4))),
                   tmp_path / "one.json")
        result = simulate(scene_at(design, int(row["scene"])), read_card(tmp_path / "one.json"))
        assert result.readings is not None
        assert [row[name] for name in voltage_columns(208)] == result.readings.touched_V.ravel().tolist()
        assert row["delta_max_mm"] == result.touches[0].depth_m * 1e3
    assert len(set(table["card_sample"])) == 2
    assert {*PARAMETERS, "fraction_non_elliptic"} <= set(table.columns)


@pytest.mark.slow
def test_rows_do_not_depend_on_workers_or_stops_and_the_count_may_grow(card: Path, tmp_path: Path) -> None:
    account(card, tmp_path / "a", 2)
    assert account(card, tmp_path / "a", 6, workers=2).kept == 2
    account(card, tmp_path / "b", 6)
    a, b = (read_dataset(tmp_path / name).table.drop(columns=list(COST)) for name in "ab")
    pd.testing.assert_frame_equal(a, b)
    assert Counter(a["card_sample"]).most_common()[0][1] == 2
    told = {one.kind: one for one in account_of(tmp_path / "b").left_out}
    assert Kind.ONE_CARD not in told
    drawn = told[Kind.DRAWN_CARDS]
    assert (drawn.unbounded, drawn.rows) == (True, drawn.of)
    assert "law and prony and conductivity vary" in drawn.reason
    assert "1/sqrt(5) = 0.45" in drawn.reason


@pytest.mark.slow
def test_skins_drawn_for_one_foam_share_its_load_paths_and_drawn_foams_have_none(
        card: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TOUCHCAL_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(reuse, "DEPTHS", (0.035, 0.05, 0.065))
    monkeypatch.setattr(build_table, "_CHECKS", 3)
    raw = RAW | {"material": {"draws": 5, "parts": ["conductivity"]}}
    last = sweep(design_from(raw, 3), card, tmp_path / "a", reuse=True).account
    assert last is not None
    assert "a table of 1 load paths" in last.method
    assert read_dataset(tmp_path / "a").table["card_sample"].nunique() == 3
    with pytest.raises(ValueError, match="a law for each row"):
        sweep(design_from(RAW, 3), card, tmp_path / "b", reuse=True)


def test_another_posterior_or_material_is_refused(card: Path, tmp_path: Path) -> None:
    own = written(tmp_path, posterior())
    account(own, tmp_path / "a", 1)
    assert len(read_manifest(tmp_path / "a")["posterior"]["sha256"]) == 64
    with pytest.raises(ValueError, match=r"its draws in \[material\] is"):
        account(own, tmp_path / "a", 1, RAW | {"material": {"draws": 6}})
    write_draws(replace(posterior(), omega=np.full(COUNT, 0.3)), tmp_path / "card.d" / "posterior.nc", {})
    with pytest.raises(ValueError, match="another posterior"):
        account(own, tmp_path / "a", 1)


def test_a_drawn_card_that_is_no_material_is_a_row(tmp_path: Path) -> None:
    draws = posterior()
    assert draws.conductivity_S_per_m is not None
    draws.conductivity_S_per_m[-1, 0] = -1.0
    raw = RAW | {"material": {"draws": COUNT}}
    made = cards(written(tmp_path, draws), draws=COUNT)
    bad = next(i for i in range(COUNT) if made.samples[draw_of(made, i)] == COUNT - 1)
    with pytest.raises(ValueError, match="c0_S_per_m must be positive"):
        card_at(made, bad)
    (row,) = solve_rows(design_from(raw, COUNT), made, [bad])
    assert (row["outcome"], row["card_sample"], row["c0_S_per_m"]) == ("refused", COUNT - 1, -1.0)
    assert "c0_S_per_m must be positive" in row["message"]
    assert np.isnan(row["dv_000"])


@pytest.mark.parametrize(("table", "named"), [
    ({"draws": COUNT + 1}, "holds 40"), ({"parts": ["prony", "skin"]}, "conductivity"), ({"parts": []}, "some of"),
    ({"draws": -1}, "draws"), ({"rows_per_draw": 0}, "rows_per_draw"), ({"specimen": 1}, "true or false"),
    ({"cards": 3}, "unknown key 'cards'"), ({"specimen": True, "parts": ["prony"]}, "leaves the law out")])
def test_mistakes_in_the_table_are_named(card: Path, table: dict, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        cards(card, **table)


def test_what_a_posterior_lacks_is_named(tmp_path: Path) -> None:
    path = written(tmp_path, foam_draws(np.tile(MU, (COUNT, 1)), np.tile(ALPHA, (COUNT, 1)), np.zeros((COUNT, 3))))
    with pytest.raises(ValueError, match="names conductivity, and the posterior"):
        cards(path, parts=["conductivity"])
    with pytest.raises(ValueError, match="no scatter between specimens"):
        cards(path, specimen=True)
    itself = read_card(path)
    with pytest.raises(ValueError, match="did not converge"):
        cards_for(Material(), 0, replace(itself, posterior={**itself.posterior, "checks": {"converged": False}}))
    write_card(replace(itself, posterior={}), path)
    with pytest.raises(ValueError, match="--posterior"):
        cards(path)
    assert cards(path, posterior=False).draws is None


def test_rows_without_material_are_of_the_card_itself() -> None:
    assert recorded(Cards(MaterialCard("bare")), 5) == {"card_sample": -1}
    assert card_number(design_from({"scenes": 9}), 7) == 7
