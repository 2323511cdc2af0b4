"""Rubber laws as input of finite-element programs: constants read back against each program's documented energy."""

from __future__ import annotations

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from matcal.card import MaterialCard
from matcal.laws.deformation_modes import hereditary_stress
from matcal.laws.law import Law
from matcal.laws.neo_hooke import NeoHooke
from matcal.laws.prony import Prony, convolve
from matcal.laws.rubbers.arruda_boyce import ArrudaBoyce
from matcal.laws.rubbers.extended_tube import ExtendedTube
from matcal.laws.rubbers.gent import Gent
from matcal.laws.rubbers.mooney_rivlin import MooneyRivlin
from matcal.laws.rubbers.mooney_rivlin_5 import MooneyRivlin5
from matcal.laws.rubbers.ogden import Ogden
from matcal.laws.rubbers.yeoh import Yeoh
from matcal.record.exporters.deck import export
from matcal.record.importers.read_deck import import_deck

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
            "lsdyna": lsdyna_energy, "openradioss": radioss_energy}
MISSING = {"abaqus": ("gent", "extended_tube"), "calculix": ("gent", "extended_tube"), "ansys": (),
           "febio": ("mooney_rivlin_5", "extended_tube"), "lsdyna": ("gent", "extended_tube"),
           "openradioss": ("mooney_rivlin_5", "yeoh", "gent", "arruda_boyce", "extended_tube")}


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


FAST = Prony([0.3, 0.1], [0.5, 20.0])


@pytest.mark.parametrize("held", ["instantaneous", "longterm"])
@pytest.mark.parametrize("law", [Ogden([2e5, 1e4, 3e3], [3.0, 7.0, -2.0]), Gent(2e5, 60.0), MooneyRivlin(7e4, 3e4),
                                 Yeoh(1e5, 1e3, 10.0), ArrudaBoyce(2e5, 4.0)], ids=lambda law: law.name)
def test_febio_relaxes_the_law_by_its_shares(law, held: str) -> None:
    """G(t) times the energy that is written: 0.6 of the instantaneous one at last, in 1/ms of its units."""
    text = export(MaterialCard("rubber", replace(law, moduli=held), FAST), "febio", units="mm-kg-ms").text
    root = ElementTree.fromstring(text)
    material = root.find("Material/material")
    assert material is not None
    assert material.get("type") == "uncoupled viscoelastic"
    value = {child.tag: float(child.text or "nan") for child in material if len(child) == 0}
    assert value["pressure_model"] == 2
    assert value["k"] > 0
    assert material.find("elastic/k") is None  # FEBio adds both
    assert (value["t1"], value["t2"]) == (500.0, 20000.0)
    whole = 1.0 if held == "instantaneous" else 0.6
    np.testing.assert_allclose([value["g0"], value["g1"], value["g2"]], [0.6 / whole, 0.3 / whole, 0.1 / whole])
    inner = text[text.index("<elastic"):].replace("</elastic>", f"<k>{value['k']}</k>")
    np.testing.assert_allclose(febio_energy(inner), law.energy(X) * 1e-9, rtol=1e-10)


def test_febio_takes_six_terms_and_is_elastic_with_more() -> None:
    card = MaterialCard("rubber", Gent(2e5, 60.0), Prony([0.05] * 7, np.logspace(-2, 4, 7)))
    deck = export(card, "febio")
    assert 'type="Gent"' in deck.text
    assert any("at most 6 terms, the card has 7" in warning for warning in deck.warnings)


def test_a_ramp_to_twice_the_length_in_febio_is_two_per_cent_stiffer() -> None:
    """FEBio's formula: the deviator of S relaxes, a pressure frees the faces; the card's: S with that pressure."""
    law = Yeoh(2e5, -2e3, 40.0, moduli="instantaneous")
    series = Prony([0.15, 0.17, 0.06], [0.29, 5.85, 81.7])
    t = np.concatenate([np.linspace(0, 10, 800), 10 + np.geomspace(0.05, 300, 200)])
    stretch = 1 + np.minimum(t / 10, 1)
    x = np.log(stretch)[:, None] * [1, -0.5, -0.5]
    s = (tau := law.kirchhoff(x)) - tau.mean(axis=1, keepdims=True)
    relaxed = np.exp(2 * x) * np.stack([convolve(series, t, c) for c in (s * np.exp(-2 * x)).T], axis=1)
    febio = (relaxed[:, 0] - relaxed[:, 1]) / stretch
    ratio = febio / np.where(t > 0, hereditary_stress(law, series, "uniaxial", t, stretch - 1), 1)
    print(f"FEBio over card: {ratio[799]:.4f} at the end of the ramp, {ratio[-1]:.4f} at the end of the hold")
    assert ratio[799] == pytest.approx(1.022, abs=3e-3)
    assert ratio[-1] == pytest.approx(1, abs=2e-4)


@pytest.mark.parametrize("held", ["instantaneous", "longterm"])
@pytest.mark.parametrize("law", [Ogden([2e5], [3.0]), MooneyRivlin(7e4, 3e4), ArrudaBoyce(2e5, 4.0)],
                         ids=lambda law: law.name)
def test_lsdynas_terms_relax_a_small_shear_as_the_card_does(law, held: str, tmp_path) -> None:
    """Long-term law and G_i exp(-BETA_i t) of the documented sum; read back, the card's series."""
    card = MaterialCard("rubber", replace(law, moduli=held), FAST)
    instantaneous = law.mu_0_Pa if held == "instantaneous" else law.mu_0_Pa / 0.6
    deck = export(card, "lsdyna", units="mm-t-s")
    terms = [line for line in deck.text.split("betai")[1].splitlines()[1:] if line]
    gi, betai, vflag = np.array([[float(line[i:i + 20]) for i in (0, 20, 40)] for line in terms]).T
    np.testing.assert_allclose(gi, [0.3e-6 * instantaneous, 0.1e-6 * instantaneous], rtol=1e-12)
    np.testing.assert_allclose(betai, [2.0, 0.05], rtol=1e-12)
    assert not vflag.any()
    assert "long-term" in deck.text
    assert any("at small strain alone" in warning for warning in deck.warnings)
    path = tmp_path / "rubber.k"
    path.write_text(deck.text)
    back = import_deck(path, None, "mm-t-s")
    assert back.prony is not None
    assert back.law is not None
    np.testing.assert_allclose([back.prony.g, back.prony.tau_s], [FAST.g, FAST.tau_s], rtol=1e-10)
    assert back.law.moduli == "longterm"
    assert back.law.mu_0_Pa == pytest.approx(0.6 * instantaneous, rel=1e-10)


@pytest.mark.parametrize(("law", "terms", "moduli", "reason"), [
    (Ogden([2e5], [3.0]), 2, "instantaneous", "instantaneous ones were asked for"),
    (Ogden([2e5], [3.0]), 13, None, "at most 12 terms, the card has 13"),
    (ArrudaBoyce(2e5, 4.0), 7, None, "at most 6 terms, the card has 7")])
def test_lsdyna_is_elastic_where_its_terms_cannot_be_the_cards(law, terms: int, moduli, reason: str) -> None:
    series = Prony(np.full(terms, 0.04), np.logspace(-2, 4, terms))
    deck = export(MaterialCard("rubber", law, series), "lsdyna", moduli)
    assert "betai" not in deck.text
    assert any(reason in warning for warning in deck.warnings)


def test_a_program_that_needs_a_density_says_so() -> None:
    with pytest.raises(ValueError, match="density"):
        export(MaterialCard("rubber", Ogden([1e5], [2.0])), "openradioss")


def test_openradioss_answers_to_its_former_name_too() -> None:
    card = MaterialCard("rubber", Ogden([1e5], [2.0]))
    assert export(card, "radioss", density_kg_per_m3=1100.0) == export(card, "openradioss", density_kg_per_m3=1100.0)
    with pytest.raises(ValueError, match=r"known: .*ansys, openradioss\b"):
        export(card, "radios")
