"""Load paths of drawn laws as weighted means of a few: they recover touches solved anew within the stated error,
better than the central law's own, and the rows of a sweep that they make depend on nothing but design and posterior."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from eitsim.mechanics.axisymmetric.solve_axisymmetric import at_depth, touch_of
from eitsim.mechanics.load_paths import build_law_family, build_table
from eitsim.mechanics.load_paths.build_law_family import build_family, with_rim
from eitsim.mechanics.load_paths.build_rim_table import Grid, build_rim
from eitsim.mechanics.load_paths.build_table import build
from eitsim.mechanics.load_paths.law_family import places, table_of
from eitsim.mechanics.load_paths.load_path import course_of
from eitsim.mechanics.load_paths.reduced_basis import reduced_basis
from eitsim.mechanics.load_paths.rim_table import near_rim_from
from eitsim.mechanics.load_paths.table import shape_of, touch_from
from eitsim.mechanics.rim.solve_near_rim import solve_near_rim
from eitsim.scene.scene import Body, Punch, scene_from
from eitsim.simulation import reuse
from eitsim.simulation.simulate import solve_scene
from eitsim.sweeps.dataset.parquet import COST, read_dataset
from eitsim.sweeps.dataset.sweep_record import Account
from eitsim.sweeps.design.card_draws import Material, cards_for
from eitsim.sweeps.design.design import design_from
from eitsim.sweeps.run import load_path_choice
from eitsim.sweeps.run.load_path_choice import REPAYS, family_repays, fine_enough_for, span_for
from eitsim.sweeps.run.sweep import sweep
from matcal.card import MaterialCard, read_card, write_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.posterior.draws import Draws, write_draws
from touchcal import cache

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm")
SKIN = Conductivity(30.0, [-2, 2, -1], (0, 0.4))
SPREAD, COUNT = 0.002, 12
DEPTHS = (0.06, 0.07, 0.085)
DEEP = (0.055, 0.07, 0.085, 0.1)  # depths that a table of what the rim changes needs


def moduli(count: int = COUNT) -> np.ndarray:
    """Moduli (count, 3) about the foam's."""
    return FOAM.mu_Pa * np.exp(SPREAD * np.random.default_rng(4).standard_normal((count, 3)))


LAWS = [replace(FOAM, mu_Pa=mu) for mu in moduli()]


@pytest.fixture(scope="module")
def family():
    return made(DEPTHS)


def made(depths: tuple[float, ...]):
    """A family whose error comes from a few touches, so that it is made in seconds."""
    span = reduced_basis(LAWS)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build_table, "_CHECKS", 4)
        patch.setattr(build_law_family, "_CHECKS", 3)
        return build_family(build(shape_of(span.central, Body(), Punch()), depths=depths), span)


def stored(family, law: Hyperfoam, punch: Punch):
    own = table_of(family, law)
    assert own is not None
    touch = touch_from(own, law, Body(), punch)
    assert touch is not None
    return touch


def test_drawn_laws_are_recovered_within_the_stated_error(family) -> None:
    """Touches solved anew on the mesh of the paths at a few depths, and together three times nearer than those of the
    central law, which for one of the laws is near."""
    span, depths = family.span, (0.072, 0.075, 0.078)
    free = [law for law in LAWS if not any(law is one for one in (span.central, *span.chosen, *span.held_out))]
    assert len(span.chosen) == 2
    for law in [*free[:2], span.chosen[0]]:
        levels, off = [*course_of(law, Body(), Punch()).levels], []
        scaled = replace(span.central, mu_Pa=span.central.mu_Pa / (span.central.mu_0_Pa / law.mu_0_Pa))
        for depth in depths:
            fresh = touch_of(law, Body(), levels, at_depth(levels, depth), 0.0)
            punch = Punch(depth_m=depth * Body().thickness_m, force_N=None)
            touch, central = (stored(family, one, punch) for one in (law, scaled))
            off.append([abs(one.force_N / fresh.force_N - 1) for one in (touch, central)])
            assert 0 < off[-1][0] < 2 * family.table.error.depth < 1e-2
            assert touch.sigma_max_Pa == pytest.approx(fresh.sigma_max_Pa, rel=0.03)
            assert touch.contact_area_m2 == pytest.approx(fresh.contact_area_m2, rel=5e-3)
        missed, zeroth = np.linalg.norm(off, axis=0)
        print(off, family.table.error)
        assert missed < zeroth / 3


def test_the_central_law_keeps_its_paths(family) -> None:
    own = table_of(family, family.span.central)
    assert own is not None
    assert own.values.tolist() == family.table.values.tolist()
    assert own.shape == family.table.shape


def test_a_law_of_the_span_keeps_the_pressures_that_were_solved(family) -> None:
    """Its mean is its own path where that was solved; there the paths start from the same equilibria."""
    own, (some, depths) = table_of(family, family.span.chosen[1]), places(family.table)
    assert own is not None
    at = np.ix_(some, depths)
    np.testing.assert_allclose(own.values[at] - family.table.values[at], family.values[1], rtol=0, atol=1e-12)


def test_a_scene_says_that_its_law_is_a_mean_and_a_law_beyond_is_solved_directly(family) -> None:
    scene = scene_from({"punch": {"x_mm": 20, "force_N": 0.25}, "accuracy": {"signal": 0.05}})
    near, far = (solve_scene(scene, MaterialCard("drawn", law, None, SKIN), table=family)
                 for law in (LAWS[0], replace(FOAM, alpha=1.01 * FOAM.alpha)))
    (said,) = [d for d in near.plan.decisions if d.decision == "load path reused"]
    assert "weighted mean of those of 3 drawn laws" in said.reason
    assert said.error_bound == 2 * max(family.table.error.depth, family.table.error.signal(scene.skin.strain))
    assert "load path reused" not in [d.decision for d in far.plan.decisions]


def test_paths_too_rough_for_a_design_are_left_out_and_it_is_told(family) -> None:
    rough = replace(family.table, error=replace(family.table.error, signals=np.array([0.01, 1.0, 1.0])))
    for signal, kept in ((0.02, False), (0.05, True)):
        design = design_from({"skin": {"strain": "normal"}, "accuracy": {"signal": signal}}, 3)
        found, why = fine_enough_for(design, rough)
        assert (found is not None, "up to 1.0e-02 off" in why) == (kept, not kept)


@pytest.mark.slow
def test_near_the_rim_the_central_change_serves_within_the_stated_error() -> None:
    family = made(DEEP)
    grid = Grid((0.5, 0.7, 1.0, 1.4), (0.06, 0.075, 0.085, 0.095), (0.5, 1.0, 1.4), (0.06, 0.085, 0.095))
    whole = replace(family.table, rim=build_rim(family.table, grid=grid))
    found, law = with_rim(family, whole), family.span.held_out[-1]
    own = table_of(found, law)
    assert own is not None
    assert own.rim is not None
    assert whole.rim is not None
    assert (own.rim.error_estimate >= whole.rim.error_estimate).all()
    force_N = stored(family, law, Punch(depth_m=0.8e-3, force_N=None)).force_N
    punch = Punch(x_m=0.085, force_N=force_N)
    quick, fresh = near_rim_from(own, stored(found, law, punch), Body(), punch), solve_near_rim(law, Body(), punch)
    assert quick is not None
    missed = abs(quick.depth_m / fresh.depth_m - 1)
    print(missed, own.rim.error)
    assert quick.rim is not None
    assert quick.rim.error_estimate is not None
    assert 0 < missed < own.error.depth + quick.rim.error_estimate[0]


RAW = {"seed": 7, "punch": {"x_mm": [-30, 30], "y_mm": [-30, 30], "diameter_mm": 14, "force_N": [0.24, 0.3]},
       "accuracy": {"signal": 0.05}, "material": {"draws": 4, "parts": ["hyperfoam"]}}


@pytest.fixture
def card(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TOUCHCAL_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(reuse, "DEPTHS", (0.055, 0.07, 0.09))
    (tmp_path / "card.d").mkdir()
    write_draws(
        Draws(moduli(6), np.tile(FOAM.alpha, (6, 1)), np.zeros((6, 3))), tmp_path / "card.d" / "posterior.nc", {}
    )
    write_card(MaterialCard("drawn", FOAM, None, SKIN, posterior={"file": "card.d/posterior.nc", "n": 6}),
               tmp_path / "card.json")
    return tmp_path / "card.json"


def account(card: Path, folder: Path, scenes: int, **options) -> Account:
    last = sweep(design_from(RAW, scenes), card, folder, **options).account
    assert last is not None
    return last


@pytest.mark.slow
def test_rows_of_drawn_laws_do_not_depend_on_workers_or_the_cache(card: Path, tmp_path: Path) -> None:
    first = account(card, tmp_path / "a", 7, reuse=True)
    assert "1 load paths of a central law and what 2 other drawn laws change of them" in first.method
    cache.clear()
    account(card, tmp_path / "b", 3, reuse=True, workers=2)
    account(card, tmp_path / "b", 7)
    a, b = (read_dataset(tmp_path / name).table.drop(columns=[*COST]) for name in "ab")
    pd.testing.assert_frame_equal(a, b)
    account(card, tmp_path / "c", 3, reuse=False)
    c = read_dataset(tmp_path / "c").table
    separation = (a["delta_max_mm"].head(3) / c["delta_max_mm"] - 1).abs()
    assert len(set(c["card_sample"])) == 3
    assert (separation > 0).all()
    assert (separation < 1e-3).all()


def test_families_are_made_where_they_repay_their_cost(card: Path) -> None:
    def repaid(scenes: int) -> bool:
        design = design_from(RAW, scenes)
        return family_repays(design, *span_for(design, cards_for(Material(4), 7, read_card(card))))

    span = span_for(design_from(RAW, 1), cards_for(Material(4), 7, read_card(card)))[1]
    least = REPAYS + len(span.chosen) * load_path_choice.LAW_REPAYS + len(span.held_out) * load_path_choice.CHECK_REPAYS
    assert not repaid(least - 1)
    assert repaid(least)
