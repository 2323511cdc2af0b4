"""Depths of CalculiX on the touch of 14 mm, where its table lies next to the checkout.

Its runs and ours differ in three ways, all on its side. Its contact is a penalty at nodes whose effect on the depth is
not corrected: a tenth of the stiffness (k against K) makes the punch go 5.6 % deeper at 1 N, where the foam's plateau
makes the depth most sensitive, and 0.8 to 1.7 % elsewhere; ours moves by 2e-4 over a hundredfold, and must lie between
or near the two. Above 9 to 12 mm its foam is linear elastic, so that it never softens there. Its elements are linear:
from 0.4 to 0.1 mm its depth at 0.1 N goes down and up again by 0.5 and 0.8 %. The last two are allowed 1 %. Runs with
a sharp (s) or a rough (r) punch are other problems.
"""

from pathlib import Path

import pandas as pd
import pytest

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_path
from eitsim.scene.profiles.rounded_cone import Flat
from eitsim.scene.scene import Body, Punch
from matcal.laws.hyperfoam import Hyperfoam

TABLE = Path(__file__).parents[3].parent / "shared" / "reference" / "mechanics" / "ccx_contact_d14.csv"
TABLE_1 = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0])
FORCES_N = [0.1, 0.5, 1.0, 2.0]


def depths_mm(**keys):
    return [touch.depth_m * 1e3 for touch in solve_path(TABLE_1, Body(), Punch(diameter_m=0.014), FORCES_N, **keys)]


@pytest.mark.skipif(not TABLE.exists(), reason="the table of CalculiX's runs is not next to the checkout")
def test_depths_lie_between_two_penalties_of_calculix():
    table = pd.read_csv(TABLE).set_index(["tag", "F_mN"])["delta_mm"]
    for force, ours in zip(FORCES_N, depths_mm(), strict=True):
        soft, stiff = table[("k14c", force * 1e3)], table[("K14c", force * 1e3)]
        print(f"{force} N: {stiff} <= {ours:.5f} <= {soft}")
        assert 0.99 * stiff < ours < 1.01 * soft
        assert stiff < soft


def test_a_hundredfold_penalty_moves_the_depth_by_less_than_its_mesh():
    soft, stiff = (depths_mm(penalty=Flat.default_penalty * factor, element_m=0.12e-3) for factor in (0.1, 10.0))
    assert stiff == pytest.approx(soft, rel=5e-4)
