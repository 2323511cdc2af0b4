"""The shift of relaxation times with temperature in decks: constants of the programs' own formulas, a warning else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from matcal.card import MaterialCard, read_card, write_card
from matcal.laws.histories.time_temperature import Arrhenius, Wlf, decades
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from matcal.record.exporters.deck import export

FOAM = Hyperfoam(np.array([12e3]), np.array([2.0]), np.zeros(1), "longterm")
CARD = MaterialCard("foam", FOAM, Prony(np.array([0.2]), np.array([3.0])), shift=Wlf(9.0, 110.0, 303.15))


@pytest.mark.parametrize(("target", "keyword", "sign"), [("abaqus", "*TRS, DEFINITION=WLF", -1),
                                                         ("ansys", "TB,SHIFT,1,1,3,WLF", 1)])
def test_a_deck_shifts_times_as_the_card_does(target: str, keyword: str, sign: int) -> None:
    lines = export(CARD, target).text.splitlines()
    values = lines[lines.index(keyword) + 1].removeprefix("TBDATA,1,").split(",")
    reference, first, second = map(float, values)
    celsius = np.array([0.0, 50.0, 80.0])
    written = sign * first * (celsius - reference) / (second + celsius - reference)
    assert CARD.shift is not None
    np.testing.assert_allclose(written, -sign * decades(CARD.shift, celsius + 273.15), rtol=1e-12)


@pytest.mark.parametrize(("card", "target"), [(CARD, "febio"), (CARD, "calculix"), (CARD, "lsdyna"),
                                              (replace(CARD, shift=Arrhenius(9e4, 293.15)), "ansys")])
def test_a_program_without_the_shift_says_so(card: MaterialCard, target: str) -> None:
    assert any("shift of times" in warning for warning in export(card, target).warnings)


@pytest.mark.parametrize("shift", [Wlf(9.0, 110.0, 303.15), Arrhenius(9e4, 293.15)])
def test_a_card_keeps_its_shift(shift: Wlf | Arrhenius, tmp_path: Path) -> None:
    write_card(replace(CARD, shift=shift), tmp_path / "card.json")
    assert read_card(tmp_path / "card.json").shift == shift
