"""Loops of cycles that repeat themselves: the law against elements that slip one by one, fits of loops of others."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import matcal
from matcal.card import MaterialCard, read_card, write_card
from matcal.fitting.reloadings import lost_by_reloading
from matcal.laws.histories.damage import Damage
from matcal.laws.histories.steady_loop import missing
from matcal.laws.histories.strain_paths import follow
from matcal.laws.hyperfoam import Hyperfoam
from matcal.record.cautions import cautions
from matcal.record.exporters.deck import export
from matcal.record.predict import follow_path
from matcal.record.result_tables import softening
from matcal.reduction.experiment import StrainPath
from touchcal.errors import InputFileError

RUBBER = Hyperfoam(np.array([60e3]), np.array([2.5]), np.array([0.45]))


def through(*turns: float, points: int = 50) -> np.ndarray:
    """Strains from rest to each turn."""
    return np.r_[0.0, *(np.linspace(a, b, points + 1)[1:] for a, b in zip((0.0, *turns), turns, strict=False))]


def slipping(x: np.ndarray, turn: float, count: int = 2000) -> np.ndarray:
    """Share missing along x in [0, 1] by that many elements of one stiffness, whose slips are spread evenly."""
    slip = turn / 2 * (np.arange(count) + 0.5) / count
    force, last, out = slip.copy(), 1.0, []
    for at in x:
        force = np.clip(force + at - last, -slip, slip)
        last = at
        out.append((1 - force.sum() / slip.sum()) / 2)
    return np.array(out)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("turn", [0.15, 0.6, 1.7])
def test_the_law_is_that_of_elements_that_slip(turn: float, seed: int) -> None:
    """On random turns; first loading, before and after them, misses nothing."""
    turns = np.random.default_rng(seed).uniform(0, 0.5, 12)
    strain = through(0.5, *turns, 0.5, 0.9, 0.1, 0.45, 0.8, points=20)
    most = np.maximum.accumulate(strain)
    x = np.divide(strain, most, out=np.ones_like(strain), where=most > 0)
    np.testing.assert_allclose(missing(strain, turn), slipping(x, turn), atol=2e-3)
    np.testing.assert_allclose(missing(-strain, turn), missing(strain, turn))
    assert missing(strain, turn)[strain == most].max() < 1e-12


def test_unloading_meets_the_closed_form_and_inner_cycles_close() -> None:
    """By a quarter of the largest strain at turn 0.5: u = 1/2 and 3/4 of the share; an inner cycle leaves no trace."""
    strain = np.array([0.0, 0.8, 0.6, 0.7, 0.6, 0.4, 0.8])
    found = missing(strain, 0.5)
    np.testing.assert_allclose(found[[1, 2, 4, 6]], [0, 0.75, 0.75, 0], atol=1e-12)
    assert found[3] == pytest.approx(0.75 - (2 * 0.25 - 0.25**2))
    assert found[5] == missing(strain[[0, 1, 5]], 0.5)[2] == 1


@pytest.mark.parametrize("seed", range(5))
def test_no_closed_cycle_gives_work(seed: int) -> None:
    rng = np.random.default_rng(seed)
    strain = through(1.0, *rng.uniform(0.1, 1.0, 6))
    cycle = through(*rng.uniform(0.1, 1.0, 8))[1:] * 0.8
    closed = np.r_[np.linspace(strain[-1], cycle[0], 50), cycle, np.linspace(cycle[-1], strain[-1], 50)]
    whole = np.r_[strain, closed, closed]
    stress = follow(RUBBER, "uniaxial", whole, Damage(2.0, 5e3, 0.0, 0.0, 0.3, 0.4))
    last = slice(-closed.size, None)
    assert np.trapezoid(stress[last], whole[last]) > 0


@pytest.mark.parametrize(("kind", "loss", "stress"), [
    ("exponential", 0.03, 0.03), ("friction", 0.05, 0.15)])
def test_a_loop_of_another_law_is_followed(kind: str, loss: float, stress: float,
                                           benchmark_module: Callable[[str], ModuleType]) -> None:
    """Cycles inside cycles that the fit did not see; without a loop their loss is off by 0.08 to 0.2."""
    row = benchmark_module("steady_loops").row(kind, 4)
    assert row["loop_share"] > 0
    assert row["other_loss_error"] < loss
    assert row["other_rms"] < stress


@pytest.mark.thorough
def test_hidden_loops_lie_in_their_intervals(benchmark_module: Callable[[str], ModuleType]) -> None:
    """Nine of ten of all numbers, as 45 of 50; where there is no loop none is found."""
    rows = [benchmark_module("steady_loops").row("own", seed) for seed in range(100, 106)]
    assert np.mean([value for row in rows for name, value in row.items() if name.endswith("_held")]) >= 0.9
    assert not any(benchmark_module("steady_loops").row("none", seed)["looped"] for seed in range(100, 103))


def test_one_unloading_alone_shows_no_loop() -> None:
    strain = through(0.8, 0.0)
    stress = follow(RUBBER, "uniaxial", strain, Damage(2.0, 5e3, 0.0, 0.0, 0.2, 0.3))
    card = matcal.fit([{"uniaxial": (strain, stress)}], branch="all", order=1, poisson=0.45).card
    assert card.softening is not None
    assert card.softening.loop_share == 0
    assert any("tells a loop from softening" in sentence for sentence in card.provenance["decisions"])


def test_a_loop_that_comes_at_once_is_in_the_law() -> None:
    """A fifth of the stress is missing in unloading: the last cycle loses a fifth, and Mind says nothing of it."""
    strain = through(0.4, 0.0, 0.4, 0.0, 0.8, 0.0, 0.8, 0.0)
    stress = follow(RUBBER, "uniaxial", strain, Damage(2.0, 5e3)) * np.where(np.diff(strain, prepend=0) < 0, 0.8, 1)
    card = matcal.fit([{"uniaxial": (strain, stress)}], branch="all", order=1, poisson=0.45).card
    (measured, law), = card.fit["softening"]["lost"]
    assert measured == pytest.approx(0.2, abs=0.02)
    assert law == pytest.approx(measured, abs=0.02)
    assert not any("last cycle loses" in sentence for sentence in cautions(card))
    assert any("The last cycle loses" in note for note in softening(card).notes)
    assert [row[0] for row in softening(card).rows][-2:] == ["loop_share", "loop_turn"]


def test_what_the_loop_leaves_of_the_last_cycle_is_minded() -> None:
    card = MaterialCard("foam", RUBBER, softening=Damage(2.0, 5e3, 0.0, 0.0, 0.1, 0.3),
                        fit={"softening": {"lost": [[0.25, 0.1]]}})
    assert any("25 % of the work put in, of which softening and its loop have 10 %: the rest" in sentence
               for sentence in cautions(card))


def test_a_share_on_its_bound_is_minded() -> None:
    on, off = (cautions(MaterialCard("foam", RUBBER, softening=Damage(2.0, 5e3, 0.0, 0.0, share, 0.3)))
               for share in (0.95, 0.9))
    assert [any("ended on the bound of its search, 0.95" in sentence for sentence in rows) for rows in (on, off)] == [
        True, False]


def test_work_of_loading_again_is_that_of_triangles() -> None:
    """Up 0 to 1 Pa, down to 0 at half the stress, again: between the two branches half the work put in."""
    strain = through(1.0, 0.0, 1.0, 0.0)
    stress = strain * np.where(np.diff(strain, prepend=0) < 0, 0.5, 1.0)
    (lost, put), = lost_by_reloading(StrainPath(strain, stress, None, 0.0), stress)
    assert (lost, put) == (pytest.approx(0.25, abs=0.01), pytest.approx(0.5, abs=0.01))
    assert lost_by_reloading(StrainPath(strain[:101], stress[:101], None, 0.0), stress[:101]) == []
    other = through(1.0, -1.0, 0.5)
    assert lost_by_reloading(StrainPath(other, other, None, 0.0), other) == []


def test_a_card_keeps_its_loop_and_decks_say_that_they_have_none(tmp_path: Path) -> None:
    damage = Damage(2.0, 5e3, 0.1, 0.05, 0.2, 0.4)
    card = MaterialCard("foam", RUBBER, softening=damage)
    write_card(card, tmp_path / "card.json")
    assert read_card(tmp_path / "card.json").softening == damage
    for program in ("abaqus", "ansys", "calculix"):
        assert any("loop of a cycle" in text and "0.2 of the stress" in text for text in export(card, program).warnings)
    plain = MaterialCard("foam", RUBBER, softening=Damage(2.0, 5e3))
    write_card(plain, tmp_path / "plain.json")
    assert "loop" not in (tmp_path / "plain.json").read_text(encoding="utf-8")
    assert read_card(tmp_path / "plain.json").softening == Damage(2.0, 5e3)


def test_a_history_follows_the_loop_of_a_card() -> None:
    """Unloading from 0.8 to 0.4 at turn 0.5 lacks the whole share."""
    plain, looped = (MaterialCard("foam", RUBBER, softening=Damage(2.0, 5e3, 0.0, 0.0, *loop)) for loop in (
        (), (0.3, 0.5)))
    strain = np.array([0.0, 0.8, 0.4, 0.8])
    one, two = (follow_path(card, "uniaxial", strain)["stress_Pa"] for card in (plain, looped))
    np.testing.assert_allclose(two[1:] / one[1:], [1, 0.7, 1], rtol=1e-12)


def test_a_loop_without_a_turn_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="loop_turn above 0"):
        Damage(2.0, 5e3, loop_share=0.1)
    card = MaterialCard("foam", RUBBER, softening=Damage(2.0, 5e3, 0.0, 0.0, 0.2, 0.4))
    path = tmp_path / "card.json"
    write_card(card, path)
    path.write_text(path.read_text(encoding="utf-8").replace('"loop_turn": 0.4', '"loop_turn": 0'), encoding="utf-8")
    with pytest.raises(InputFileError, match="loop_turn"):
        read_card(path)
