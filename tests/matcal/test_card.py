"""Cards: a round trip keeps every part, bad files are named by key, absent parts say what would give them."""

import json
from pathlib import Path

import numpy as np
import pytest

from matcal.card import MaterialCard, as_json, read_card, require, with_moduli, write_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from touchcal.errors import InputFileError

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "instantaneous",
                 {"uniaxial": (-0.8, 0.0)})
WHOLE = MaterialCard("foam", FOAM, Prony([0.15, 0.17, 0.06], [0.3, 5.8, 82.0]),
                     Conductivity(30.0, [-2, 2, -1], (0.0, 0.4)), fit={"uniaxial": {"rms": 1.0}}, data="foam.d")


def test_round_trip(tmp_path: Path) -> None:
    write_card(WHOLE, tmp_path / "card.json")
    assert as_json(read_card(tmp_path / "card.json")) == as_json(WHOLE)
    assert [p.name for p in tmp_path.iterdir()] == ["card.json"]


def test_absent_parts_are_absent_and_named(tmp_path: Path) -> None:
    write_card(MaterialCard("bare", FOAM), tmp_path / "card.json")
    assert set(json.loads((tmp_path / "card.json").read_text())) == {"schema", "name", "hyperfoam"}
    with pytest.raises(ValueError, match=r"no conductivity.*matcal fit"):
        require(read_card(tmp_path / "card.json"), "conductivity", "the skin")


@pytest.mark.parametrize(("change", "named"), [
    ({"schema": 99}, "schema 99"), ({"hyperfoam": {"mu_Pa": [1.0], "alpha": [2.0]}}, "'nu'"),
    ({"hyperfoam": {"mu_Pa": [1.0, 2.0], "alpha": [2.0], "nu": [0.0], "moduli": "longterm"}}, "one length"),
    ({"colour": "red"}, "colour"), ({"prony": {"g": [0.6, 0.6], "tau_s": [1.0, 2.0]}}, "below 1"),
    ({"conductivity": {"c0_S_per_m": -1, "a": [0, 0, 0], "strain_range": [0, 1]}}, "positive")])
def test_bad_cards_are_named(tmp_path: Path, change: dict, named: str) -> None:
    path = tmp_path / "card.json"
    path.write_text(json.dumps(as_json(WHOLE) | change))
    with pytest.raises(InputFileError, match=named) as caught:
        read_card(path)
    assert "card.json" in str(caught.value)


def test_broken_json_names_the_line(tmp_path: Path) -> None:
    (tmp_path / "card.json").write_text('{"schema": 1,\n "name": }')
    with pytest.raises(InputFileError, match="line 2"):
        read_card(tmp_path / "card.json")


def test_nothing_is_half_written(tmp_path: Path) -> None:
    path = tmp_path / "card.json"
    write_card(WHOLE, path)
    before = path.read_bytes()
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_card(MaterialCard("bad", FOAM, fit={"rms": float("nan")}), path)
    assert path.read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


def test_moduli_scale_by_the_relaxed_fraction() -> None:
    long = with_moduli(WHOLE, "longterm")
    assert long.mu_0_Pa == pytest.approx(9530 * (1 - 0.38))
    back = with_moduli(MaterialCard("long", long, WHOLE.prony), "instantaneous")
    np.testing.assert_allclose(back.mu_Pa, FOAM.mu_Pa)
    with pytest.raises(ValueError, match="known: card"):
        with_moduli(WHOLE, "dynamic")
