"""What a user of Python may give by mistake is refused in words, before anything is written."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eitsim
import matcal

ROOT = Path(__file__).parents[1]
FOAM = matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm")
CARD = matcal.MaterialCard("foam", FOAM, conductivity=matcal.Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
BASELINE = np.ones((16, 13))


@pytest.mark.parametrize(("call", "words"), [
    (lambda: matcal.fit([]), "no test was given"),
    (lambda: eitsim.plan(eitsim.Scene(), {"name": "foam"}), "a card is a MaterialCard or the path of one, got dict"),
    (lambda: eitsim.plan(eitsim.Scene(punches=[eitsim.Punch(x_m=np.nan)]), CARD), r"x_mm in .*, got nan"),
    (lambda: eitsim.plan(eitsim.Scene(body=eitsim.Body(eitsim.Disc(np.inf))), CARD), r"radius_mm in .*, got inf"),
    (lambda: eitsim.reconstruct(BASELINE.T, BASELINE), r"frames_V has the shape \(13, 16\)"),
    (lambda: eitsim.reconstruct(np.ones((2, 104)), BASELINE), r"frames_V has the shape \(2, 104\)")])
def test_wrong_values_are_named(call: Callable[[], Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        call()


def test_a_card_is_not_written_over_a_folder_nor_half(tmp_path: Path) -> None:
    found = matcal.fit([ROOT / "data_raw" / "uniaxial.csv"], order=1)
    (tmp_path / "place").mkdir()
    for place, words in (("place", "is a folder, and a card is a file"), ("none/card.json", "does not exist")):
        with pytest.raises(ValueError, match=words):
            found.save(tmp_path / place)
    assert [path.name for path in tmp_path.iterdir()] == ["place"]


def test_lists_and_arrays_describe_electrodes_as_tuples_do() -> None:
    one, other = (eitsim.Electrodes(width_m=kind([0.004] * 16)) for kind in (list, np.array))
    assert one == other == eitsim.Electrodes(width_m=(0.004,) * 16)
    assert hash(one) == hash(other)
