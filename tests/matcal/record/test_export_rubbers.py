"""Rubber laws as input of finite-element programs: constants read back against each program's documented energy."""

from __future__ import annotations

import re

import numpy as np
import pytest

from matcal.card import MaterialCard
from matcal.laws.law import Law
from matcal.laws.neo_hooke import NeoHooke
from matcal.laws.prony import Prony
from matcal.laws.rubbers.arruda_boyce import ArrudaBoyce
from matcal.laws.rubbers.extended_tube import ExtendedTube
from matcal.laws.rubbers.gent import Gent
from matcal.laws.rubbers.mooney_rivlin import MooneyRivlin
from matcal.laws.rubbers.mooney_rivlin_5 import MooneyRivlin5
from matcal.laws.rubbers.ogden import Ogden
from matcal.laws.rubbers.yeoh import Yeoh
from matcal.record.exporters.deck import export

LAWS = (NeoHooke(3e5, 0.5), MooneyRivlin(2e5, 3e4), MooneyRivlin5(2e5, 3e4, 1e3, -2e2, 30.0), Yeoh(2e5, -2e3, 40.0),
        Ogden([4e5, 3e3, 2e4], [1.3, 5.0, -2.0]), Gent(3e5, 60.0), ArrudaBoyce(3e5, 4.0),
        ExtendedTube(2e5, 0.09, 2e5, 0.3))
X = np.array([[0.4, -0.1, -0.3], [0.9, -0.45, -0.45], [-0.5, 0.2, 0.3]])  # logarithmic stretches, J = 1
I_1, I_2 = np.exp(2 * X).sum(axis=1) - 3, np.exp(-2 * X).sum(axis=1) - 3
SERIES = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)


def deck(law: Law, target: str, **more) -> str:
    return export(MaterialCard("rubber", law), target, density_kg_per_m3=1100.0, **more).text


def values(text: str, mark: str) -> list[float]:
    """Numbers of the lines of input after the one with a mark."""
    lines = [line for line in text[text.index(mark):].splitlines()[1:] if not line.startswith(("**", "!", "$", "#"))]
    return [float(v) for v in re.findall(r"(?<![\w])[-+]?\d[\d.]*(?:e[-+]?\d+)?", " ".join(
        line.partition("TBDATA,")[2].partition(",")[2] or line for line in lines), re.IGNORECASE)]


def powers(pairs, size=lambda m, a: m / a) -> np.ndarray:
    return sum(size(m, a) * (np.exp(a * X).sum(axis=1) - 3) for m, a in pairs if m)


def eight_chains(mu: float, lock: float) -> np.ndarray:
    return sum(mu * c / lock ** (2 * i) * ((I_1 + 3) ** (i + 1) - 3 ** (i + 1)) for i, c in enumerate(SERIES))


def abaqus_energy(text: str) -> np.ndarray:
    keyword = re.findall(r"\*HYPERELASTIC, ([^,\n]+)", text)[0]
    v = values(text, "*HYPERELASTIC")
    return {"MOONEY-RIVLIN": lambda: v[0] * I_1 + v[1] * I_2,
            "POLYNOMIAL": lambda: v[0] * I_1 + v[1] * I_2 + v[2] * I_1**2 + v[3] * I_1 * I_2 + v[4] * I_2**2,
            "YEOH": lambda: v[0] * I_1 + v[1] * I_1**2 + v[2] * I_1**3,
            "ARRUDA-BOYCE": lambda: eight_chains(v[0], v[1]),
            "OGDEN": lambda: powers(zip(v[0:6:2], v[1:6:2], strict=True), lambda m, a: 2 * m / a**2)}[keyword]()


def ansys_energy(text: str) -> np.ndarray:
    option, v = re.findall(r"TB,HYPER,1,1,\d,(\w+)", text)[0], values(text, "TB,HYPER")
    two = len(v) == 3
    return {"MOONEY": lambda: v[0] * I_1 + v[1] * I_2 + (
                0 if two else v[2] * I_1**2 + v[3] * I_1 * I_2 + v[4] * I_2**2),
            "YEOH": lambda: v[0] * I_1 + v[1] * I_1**2 + v[2] * I_1**3, "BOYCE": lambda: eight_chains(v[0], v[1]),
            "GENT": lambda: -v[0] * v[1] / 2 * np.log(1 - I_1 / v[1]),
            "ETUBE": lambda: v[0] / 2 * ((1 - v[1]**2) * I_1 / (1 - v[1]**2 * I_1) + np.log(1 - v[1]**2 * I_1))
            + 2 * v[2] / v[3]**2 * (np.exp(-v[3] * X).sum(axis=1) - 3),
            "OGDEN": lambda: powers(zip(v[0:6:2], v[1:6:2], strict=True))}[option]()


def febio_energy(text: str) -> np.ndarray:
    kind = re.findall(r'type="([^"]+)"', text)[0]
    v = {tag: float(value) for tag, value in re.findall(r"<(\w+)>([^<]+)</", text)}
    assert v["k"] > 0
    return {"Mooney-Rivlin": lambda: v["c1"] * I_1 + v["c2"] * I_2,
            "Yeoh": lambda: v["c1"] * I_1 + v["c2"] * I_1**2 + v["c3"] * I_1**3,
            "Arruda-Boyce": lambda: eight_chains(v["mu"], v["N"] ** 0.5),
            "Gent": lambda: -v["G"] * v["Jm"] / 2 * np.log(1 - I_1 / v["Jm"]),
            "Ogden": lambda: powers([(v[f"c{i}"], v[f"m{i}"]) for i in (1, 2, 3)], lambda c, m: c / m**2)}[kind]()


def lsdyna_energy(text: str) -> np.ndarray:
    keyword = re.findall(r"\*MAT_(\w+)\+", text)[0]
    v = values(text, "*MAT_")
    if keyword == "ARRUDA_BOYCE_RUBBER":
        return eight_chains(v[3], v[4] ** 0.5)
    c = v[8:]
    return (c[0] * I_1 + c[1] * I_2 + c[2] * I_1 * I_2 + c[3] * I_1**2 + c[4] * I_2**2 + c[5] * I_1**3
            if keyword == "HYPERELASTIC_RUBBER" else powers(zip(c[:8], c[8:], strict=True)))


def radioss_energy(text: str) -> np.ndarray:
    v = values(text, "/MAT/LAW42")[-10:]
    return powers(zip(v[:5], v[5:], strict=True))


ENERGIES = {"abaqus": abaqus_energy, "calculix": abaqus_energy, "ansys": ansys_energy, "febio": febio_energy,
            "lsdyna": lsdyna_energy, "radioss": radioss_energy}
MISSING = {"abaqus": ("gent", "extended_tube"), "calculix": ("gent", "extended_tube"), "ansys": (),
           "febio": ("mooney_rivlin_5", "extended_tube"), "lsdyna": ("gent", "extended_tube"),
           "radioss": ("mooney_rivlin_5", "yeoh", "gent", "arruda_boyce", "extended_tube")}


@pytest.mark.parametrize("target", ENERGIES)
@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_the_constants_make_the_cards_energy_by_the_programs_formula(law, target) -> None:
    if law.name in MISSING[target]:
        with pytest.raises(ValueError, match="alone for"):
            deck(law, target)
        return
    np.testing.assert_allclose(ENERGIES[target](deck(law, target)), law.energy(X), rtol=1e-10)


@pytest.mark.parametrize("target", ENERGIES)
def test_a_finite_volume_is_stated_and_a_kept_one_warned_of(target) -> None:
    finite = export(MaterialCard("rubber", MooneyRivlin(2e5, 3e4, 0.4995)), target, density_kg_per_m3=1100.0)
    kept = export(MaterialCard("rubber", MooneyRivlin(2e5, 3e4)), target, density_kg_per_m3=1100.0)
    assert not finite.warnings
    assert len(kept.warnings) == 1
    if target in ("abaqus", "ansys"):
        d = values(finite.text, "*HYPERELASTIC" if target == "abaqus" else "TB,HYPER")[2]
        assert 2 / d == pytest.approx(MooneyRivlin(2e5, 3e4, 0.4995).kappa_0_Pa)


def test_relaxation_goes_with_the_rubber_where_the_program_has_it() -> None:
    card = MaterialCard("rubber", Yeoh(2e5, -2e3, 40.0), Prony([0.2], [3.0]))
    assert "*VISCOELASTIC" in export(card, "abaqus").text
    text = export(card, "ansys").text
    assert values(text, "TB,HYPER")[0] == pytest.approx(2e5 / 0.8)
    assert "Prony series is not exported" in export(card, "calculix").text


def test_a_program_that_needs_a_density_says_so() -> None:
    with pytest.raises(ValueError, match="density"):
        export(MaterialCard("rubber", Ogden([1e5], [2.0])), "radioss")
