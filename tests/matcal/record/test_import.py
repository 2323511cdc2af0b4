"""Decks read back into cards: every law that goes out comes back, published spellings, and what is refused."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from matcal.card import MaterialCard, read_card, write_card
from matcal.laws.histories.damage import Damage
from matcal.laws.histories.time_temperature import Arrhenius, Wlf
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import vector
from matcal.laws.neo_hooke import NeoHooke
from matcal.laws.prony import Prony
from matcal.laws.rubbers.arruda_boyce import ArrudaBoyce
from matcal.laws.rubbers.extended_tube import ExtendedTube
from matcal.laws.rubbers.gent import Gent
from matcal.laws.rubbers.mooney_rivlin import MooneyRivlin
from matcal.laws.rubbers.mooney_rivlin_5 import MooneyRivlin5
from matcal.laws.rubbers.ogden import Ogden
from matcal.laws.rubbers.yeoh import Yeoh
from matcal.record.exporters.base import UNITS
from matcal.record.exporters.deck import export
from matcal.record.exporters.programs import target_of
from matcal.record.importers.read_deck import import_deck
from touchcal.errors import InputFileError

FOAMS = (Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0] * 3),
         Hyperfoam([2e4], [-3.0], [0.2]), Hyperfoam([3e4, 2e3], [6.0, -2.0], [0.1, 0.1]))
LAWS = (NeoHooke(3e5, 0.5), MooneyRivlin(2e5, 3e4), MooneyRivlin5(2e5, 3e4, 1e3, -2e2, 30.0), Yeoh(2e5, -2e3, 40.0),
        Ogden([4e5, 3e3, 2e4], [1.3, 5.0, -2.0]), Gent(3e5, 60.0), ArrudaBoyce(3e5, 4.0),
        ExtendedTube(2e5, 0.09, 2e5, 0.3))
X = np.array([[0.4, -0.1, -0.3], [0.9, -0.45, -0.45], [-0.5, 0.2, 0.3]])  # logarithmic stretches, J = 1
LOOSE = (MooneyRivlin(2e5, 3e4, 0.47), Ogden([2e5, 1e3], [1.5, 6.0], 0.4), Yeoh(1e5, -1e3, 50.0, 0.49))
PROGRAMS = {"abaqus": "abaqus", "ansys": "ansys", "lsdyna": "lsdyna", "calculix": "abaqus"}
PAIRS = [(program, law) for program in PROGRAMS for law in (*FOAMS, *LAWS, *LOOSE)
         if law.name in target_of(program).laws or law.name == "neo_hooke"]
CASES = [(*pair, units) for pair, units in zip(PAIRS, itertools.cycle(UNITS), strict=False)]


def read(tmp_path, text: str, *more) -> Any:
    path = tmp_path / "deck.txt"
    path.write_text(text)
    return import_deck(path, *more)


@pytest.mark.parametrize(("program", "law", "units"), CASES, ids=lambda case: getattr(case, "name", case))
def test_every_law_that_goes_out_comes_back(program, law, units, tmp_path) -> None:
    back = read(tmp_path, export(MaterialCard("m", law), program, units=units).text, None, units).law
    kept = program in ("abaqus", "ansys") or not law.incompressible
    if law.name == back.name and kept and (program != "calculix" or law.name != "hyperfoam"):
        np.testing.assert_allclose(vector(back), vector(law), rtol=1e-9, atol=1e-9)
    assert back.incompressible == (law.incompressible and kept)
    np.testing.assert_allclose(back.energy(X), law.energy(X), rtol=1e-9)  # at J = 1, where a volume adds nothing


@pytest.mark.parametrize("program", ["abaqus", "ansys"])
def test_relaxation_shift_and_softening_come_back(program, tmp_path) -> None:
    card: Any = MaterialCard("m", Ogden([4e5, 3e3], [1.3, 5.0], moduli="instantaneous"),
                        Prony([0.2, 0.1, 0.05], [0.3, 4.0, 50.0]),
                        shift=Wlf(15.0, 52.0, 293.15), softening=Damage(2.0, 3e4, 0.1))
    back = read(tmp_path, export(card, program, units="mm-kg-ms").text, None, "mm-kg-ms")
    write_card(back, tmp_path / "card.json")
    back: Any = read_card(tmp_path / "card.json")
    np.testing.assert_allclose(vector(back.law), vector(card.law), rtol=1e-12)
    assert back.law.moduli == "instantaneous"
    np.testing.assert_allclose([back.prony.g, back.prony.tau_s], [card.prony.g, card.prony.tau_s], rtol=1e-12)
    for name in ("shift", "softening"):
        np.testing.assert_allclose([*vars(getattr(back, name)).values()], [*vars(getattr(card, name)).values()])


def test_an_arrhenius_shift_comes_back_in_the_gas_constant_of_the_deck(tmp_path) -> None:
    text = "*HYPERELASTIC, YEOH\n1e5,\n*VISCOELASTIC, TIME=PRONY\n.2,,3\n*TRS, DEFINITION=ARRHENIUS\n1.5e8, 300\n"
    shift = read(tmp_path, text + "*PHYSICAL CONSTANTS, ABSOLUTE ZERO=0, UNIVERSAL GAS=8314.462618\n").shift
    assert shift == Arrhenius(pytest.approx(1.5e5), pytest.approx(300.0))


def test_abaqus_in_another_spelling(tmp_path) -> None:
    text = """*heading
 something, with commas
** a comment
*material,
 name = "Soft Skin"
*density
1.1e-9,
*Viscoelastic , time = Prony
0.25, 0.25, 2.d-1
** between data lines
.1, .1, 1e+1
*HyperElastic , n = 2 ,
  ogden , moduli = instantaneous
 0.4 , 1.3, 3.D-3, 5.
*Mullins Effect
2., 0.03, .1
*step
*hyperfoam
"""
    card = read(tmp_path, text, None, "mm-t-s")
    np.testing.assert_allclose(vector(card.law), [4e5, 3e3, 1.3, 5.0, 0.5])
    assert (card.name, card.law.moduli, card.softening) == ("Soft Skin", "instantaneous", Damage(2.0, 3e4, 0.1))
    np.testing.assert_allclose([card.prony.g, card.prony.tau_s], [[0.25, 0.1], [0.2, 10.0]])
    assert any("*DENSITY" in sentence for sentence in card.provenance["decisions"])


def test_ansys_in_another_spelling(tmp_path) -> None:
    text = """/prep7
mu0 = 0.4   ! MPa
*set,k,2000*mu0
tb,hyper,7,1,2,mooney $ tbtemp,20
tbdata,1,mu0/2-0.05,.05,2/k
mp,dens,7,1.1e-9
tb,prony,7,1,2,shear
tbdata,,.2,.5
tbdata,,.1,5.
tb,prony,7,1,2,bulk $ tbdata,1,.2,.5,.1,5.
"""
    card = read(tmp_path, text, "ansys", "mm-t-s", "7")
    assert isinstance(card.law, MooneyRivlin)
    np.testing.assert_allclose(vector(card.law)[:2], [1.5e5, 5e4])
    assert card.law.kappa_0_Pa == pytest.approx(8e8)
    assert card.law.moduli == "instantaneous"
    np.testing.assert_allclose(card.prony.tau_s, [0.5, 5.0])


@pytest.mark.parametrize("cards", [
    "         3   1.1E-9     0.495         0         0         0         0         0\n"
    "$ constants\n     0.150     0.050\n       0.1      20.0\n",
    "3,1.1E-9,.495\n.15,.05\n$\n.1,20.\n"])
def test_lsdyna_in_another_spelling(cards, tmp_path) -> None:
    card = read(tmp_path, f"*KEYWORD\n*mat_077_H_TITLE\nliner\n{cards}*END\n", "lsdyna", "mm-t-s", "liner")
    np.testing.assert_allclose(vector(card.law), [1.5e5, 5e4, 0.495])
    assert (card.prony.g[0], card.prony.tau_s[0]) == (pytest.approx(0.2), pytest.approx(0.05))


@pytest.mark.parametrize(("text", "message"), [
    ("*HYPERELASTIC, VAN DER WAALS\n1, 2, 3, 4\n", "line 1.*no law of the card"),
    ("*HYPERELASTIC, OGDEN, N=1, TEST DATA INPUT\n", "line 1.*matcal fit"),
    ("*HYPERELASTIC, YEOH\n1e5, 0, 0, 0, 0, 0, 20\n1e5, 0, 0, 0, 0, 0, 40\n", "line 3.*temperature"),
    ("*HYPERELASTIC, YEOH\n1e5, <c20>\n", "line 2.*'<c20>' is no number"),
    ("*HYPERELASTIC, NEO HOOKE\n0.4\n", "units"),
    ("*HYPERELASTIC, POLYNOMIAL, N=2\n1e5, 1e4, 0, 0, 0, 1e-8, 1e-6\n", "D_2"),
    ("*HYPERFOAM, N=1\n2e4, 3, 0.1\n*VISCOELASTIC, TIME=PRONY\n.2, 0, 3\n", "line 3.*shear and bulk"),
    ("*HYPERELASTIC, YEOH\n1e5\n*VISCOELASTIC, FREQUENCY=TABULAR\n1, 2, 3, 4\n", "line 3.*TIME=PRONY"),
    ("*HYPERELASTIC, YEOH\n", "no constants"),
    ("*MATERIAL, NAME=A\n*HYPERELASTIC, YEOH\n1e5\n*MATERIAL, NAME=B\n*HYPERELASTIC, YEOH\n1e5\n", "A, B"),
    ("*MATERIAL, NAME=A\n*ELASTIC\n2e11, .3\n", r"\*HYPERELASTIC"),
    ("TB,HYPER,1,1,3,POLY\nTBDATA,1,1e5\n", "line 1.*no law of the card"),
    ("TB,HYPER,1,1,1,NEO\nTBDATA,1,C10\n", "line 2.*'C10' is no number"),
    ("TB,HYPER,1,2,1,NEO\nTBTEMP,20\nTBDATA,1,1e5\nTBTEMP,40\nTBDATA,1,9e4\n", "2 temperatures"),
    ("*MAT_OGDEN_RUBBER\n1,1,.495,3\n", "line 2.*matcal fit"),
    ("*MAT_HYPERELASTIC_RUBBER\n1,1,.495\n", "ends after 1 card"),
    ("*MAT_SIMPLIFIED_RUBBER/FOAM\n1,1,.495\n", "none of its materials"),
    ("a,b\n1,2\n", "no law of"),
])
def test_what_is_no_law_of_the_card_is_refused_with_its_line(text, message, tmp_path) -> None:
    with pytest.raises(InputFileError, match=message):
        read(tmp_path, text)
