"""Exported cards against the targets' documented layouts and energies.

Every parser below is written from the layout in the target's manual, and every energy from the formula there, apart
from matcal's own: what is read back must give the card's nominal stress through derivatives of the target's energy.

- Abaqus Keywords Reference Guide, *HYPERFOAM, *VISCOELASTIC; Abaqus Theory Guide 4.6.2. CalculiX: User's Manual, the
  same order and energy.
- FEBio User Manual 4, "Ogden unconstrained", "viscoelastic".
- LS-DYNA Keyword User's Manual II, *MAT_HILL_FOAM (177).
- Ansys Mechanical APDL Theory Reference, "Ogden Compressible Foam Option"; Command Reference, TB, TBDATA.
"""

import cmath
import json
import re
import xml.etree.ElementTree as xml
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from matcal.card import MaterialCard, as_json
from matcal.laws.conductivity import Conductivity
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.neo_hooke import NeoHooke
from matcal.laws.prony import Prony, relaxation
from matcal.record.exporters.base import UNITS
from matcal.record.exporters.deck import export
from matcal.record.exporters.formatting import number
from matcal.record.exporters.programs import target_of, targets

TABLE_1 = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0], "instantaneous")
SERIES = Prony([0.1505, 0.1696, 0.0604], [0.2936, 5.85, 81.672])
CARD = MaterialCard("Table 1", TABLE_1, SERIES)

Energy = Callable[[complex, complex, complex], complex]

FOAMS = [name for name in targets() if "hyperfoam" in target_of(name).laws]


# energies as the manuals print them; 1/beta (J^(-alpha beta) - 1) at beta = 0 is its limit -alpha ln J

def _volumetric(j: complex, alpha: float, beta: float) -> complex:
    return -alpha * cmath.log(j) if beta == 0 else (j ** (-alpha * beta) - 1) / beta


def abaqus_energy(data: list[float], n: int) -> Energy:
    mu, alpha, nu = data[:2 * n:2], data[1:2 * n:2], data[2 * n:]
    assert len(nu) == n

    def energy(a: complex, b: complex, c: complex) -> complex:
        return sum(2 * m / p**2 * (a**p + b**p + c**p - 3 + _volumetric(a * b * c, p, v / (1 - 2 * v)))
                   for m, p, v in zip(mu, alpha, nu, strict=True))
    return energy


def febio_energy(c: list[float], m: list[float], cp: float) -> Energy:
    def energy(x: complex, y: complex, z: complex) -> complex:
        j = x * y * z
        return 0.5 * cp * (j - 1) ** 2 + sum(k / p**2 * (x**p + y**p + z**p - 3 - p * cmath.log(j))
                                             for k, p in zip(c, m, strict=True))
    return energy


def hill_energy(c: list[float], b: list[float], n: float) -> Energy:
    def energy(x: complex, y: complex, z: complex) -> complex:
        return sum(k / p * (x**p + y**p + z**p - 3 + _volumetric(x * y * z, p, n))
                   for k, p in zip(c, b, strict=True) if p != 0)
    return energy


def ansys_energy(data: list[float], n: int) -> Energy:
    mu, alpha, beta = data[:2 * n:2], data[1:2 * n:2], data[2 * n:]
    assert len(beta) == n

    def energy(x: complex, y: complex, z: complex) -> complex:
        j = x * y * z
        reduced = [v * j ** (-1 / 3) for v in (x, y, z)]
        return sum(m / p * (j ** (p / 3) * sum(v**p for v in reduced) - 3) + m / p * _volumetric(j, p, b)
                   for m, p, b in zip(mu, alpha, beta, strict=True))
    return energy


# parsers from the documented layouts

def keyword_blocks(text: str) -> dict[str, tuple[dict[str, str], list[list[str]]]]:
    """Abaqus-like input: keyword -> (parameters, rows of values); `**` is a comment."""
    blocks: dict[str, tuple[dict[str, str], list[list[str]]]] = {}
    rows: list[list[str]] = []
    for line in text.splitlines():
        if line.startswith("**"):
            continue
        if line.startswith("*"):
            keyword, *parameters = (part.strip() for part in line[1:].split(","))
            rows = []
            blocks[keyword] = (dict(p.split("=") for p in parameters), rows)
        else:
            rows.append([v.strip() for v in line.split(",")])
    return blocks


def read_abaqus(text: str) -> tuple[Energy, list[float]]:
    blocks = keyword_blocks(text)
    parameters, rows = blocks["HYPERFOAM"]
    series = [tuple(map(float, row)) for row in blocks.get("VISCOELASTIC", ({}, []))[1]]
    assert all(g == k for g, k, _ in series)
    return abaqus_energy([float(v) for row in rows for v in row], int(parameters["N"])), [v for g, _, t in series
                                                                                          for v in (g, t)]


def read_febio(text: str) -> tuple[Energy, list[float]]:
    material = xml.fromstring(text).find("Material/material")
    assert material is not None
    law = material if material.get("type") == "Ogden unconstrained" else material.find("elastic")
    assert law is not None
    assert law.get("type") == "Ogden unconstrained"
    values = {child.tag: float(child.text or "nan") for child in law if child.text and child.tag != "density"}
    n = len([tag for tag in values if re.fullmatch(r"c\d", tag)])
    g0 = material.findtext("g0")
    series = [] if g0 is None else [float(g0)] + [float(material.findtext(f"{k}{i}", "nan")) for i in range(1, 7)
                                                  for k in "gt" if material.find(f"g{i}") is not None]
    return febio_energy([values[f"c{i + 1}"] for i in range(n)], [values[f"m{i + 1}"] for i in range(n)],
                        values["cp"]), series


def read_lsdyna(text: str) -> tuple[Energy, list[float]]:
    lines = [line for line in text.splitlines() if not line.startswith("$")]
    assert lines[0] == "*MAT_HILL_FOAM+"
    cards = [[line[i:i + 20] for i in range(0, len(line), 20)] for line in lines[1:]]
    assert [len(card) for card in cards] == [8, 8, 8, 2]
    assert [int(v) for v in (cards[0][0], *cards[0][5:])] == [1, 0, 1, 0]
    return hill_energy([float(v) for v in cards[1]], [float(v) for v in cards[2]], float(cards[0][3])), []


def read_ansys(text: str) -> tuple[Energy, list[float]]:
    tables: dict[str, tuple[int, dict[int, float]]] = {}
    name = ""
    for line in text.splitlines():
        command, *values = line.split(",")
        if command == "TB":
            name = f"{values[0]} {values[4]}"
            tables[name] = (int(values[3]), {})
        elif command == "TBDATA":
            assert len(values) <= 7
            tables[name][1].update({int(values[0]) + i: float(v) for i, v in enumerate(values[1:])})
    n, data = tables["HYPER FOAM"]
    series = [list(tables[name][1].values()) for name in ("PRONY SHEAR", "PRONY BULK") if name in tables]
    assert not series or series[0] == series[1]
    return ansys_energy([data[i + 1] for i in range(len(data))], n), series[0] if series else []


READ = {"abaqus": read_abaqus, "calculix": read_abaqus, "febio": read_febio, "lsdyna": read_lsdyna,
        "ansys": read_ansys}


# nominal stress from an energy, by complex steps

def slope(function: Callable[[complex], complex], at: float) -> float:
    return function(complex(at, 1e-30)).imag / 1e-30


def stress(energy: Energy, mode: str, e: float) -> float:
    if mode == "volumetric":
        return slope(lambda j: energy(*[j ** (1 / 3)] * 3), e)
    if mode == "shear":
        def sheared(gamma: complex) -> complex:
            stretch = gamma / 2 + cmath.sqrt(1 + gamma**2 / 4)
            return energy(stretch, 1 / stretch, 1.0)
        return slope(sheared, e)
    lateral = brentq(lambda t: slope(lambda x: energy(1 + e, x, t), t), 0.5, 2.0, xtol=1e-15, rtol=8.9e-16)
    return slope(lambda x: energy(x, lateral, lateral), 1 + e)


PATHS = {"uniaxial": (-0.8, -0.5, -0.1, 0.3), "shear": (0.2, 0.7, 1.0), "volumetric": (0.3, 0.8, 1.3)}
LAWS = {
    "table 1": TABLE_1,
    "one term": Hyperfoam([8213.7], [-2.13], [0.0], "longterm"),
    "one nu": Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.21, 0.21, 0.21], "instantaneous"),
    "nu per term": Hyperfoam([5123.4, 777.1], [3.3, -1.7], [0.05, 0.31], "longterm"),
    "merged": Hyperfoam([123456.789012345, -115000.123456789, 321.987654321], [2.0123456789, 2.2, 8.1], [0.0] * 3),
    "six terms": Hyperfoam([1e4, 2e3, -500.5, 77.7, 3e3, 1.25], [1.1, 2.7, -3.3, 6.1, 0.4, 11.0], [0.1] * 6),
}
TAKES = {"abaqus": 6, "calculix": 3, "febio": 6, "lsdyna": 8, "ansys": 99}


def taken(target: str, law: Hyperfoam) -> bool:
    same_nu = np.ptp(law.nu) == 0
    return law.mu_Pa.size <= TAKES[target] and (target != "febio" or not law.nu.any()) and (
        target != "lsdyna" or bool(same_nu))


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("target", FOAMS)
def test_target_energy_gives_the_stress_of_the_card(target: str, law: str, units: str) -> None:
    card = MaterialCard(law, LAWS[law])
    if not taken(target, LAWS[law]):
        with pytest.raises(ValueError, match=r"beta|terms"):
            export(card, target, units=units)
        return
    energy, series = READ[target](export(card, target, units=units).text)
    assert not series
    for mode, path in PATHS.items():
        expected = nominal_stress(LAWS[law], mode, np.array(path))
        found = np.array([stress(energy, mode, e) for e in path]) / UNITS[units].stress
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45])
def test_febio_has_neo_hooke_at_every_ratio(nu: float) -> None:
    """W = mu/2 (I_1 - 3) - mu ln J + lambda/2 (ln J)^2 of E and v, as the manual and FENeoHookean.cpp have it."""
    law = NeoHooke(8e3, nu)
    text = export(MaterialCard("rubber", law), "febio", units="mm-t-s").text
    material = xml.fromstring(text).find("Material/material")
    assert material is not None
    assert material.get("type") == "neo-Hookean"
    young, v = (float(material.findtext(tag, "nan")) for tag in ("E", "v"))
    mu, lam = young / 2 / (1 + v), v * young / (1 + v) / (1 - 2 * v)

    def energy(x: complex, y: complex, z: complex) -> complex:
        ln_j = cmath.log(x * y * z)
        return mu * ((x**2 + y**2 + z**2 - 3) / 2 - ln_j) + lam * ln_j**2 / 2

    for mode, path in PATHS.items():
        found = np.array([stress(energy, mode, e) for e in path]) / UNITS["mm-t-s"].stress
        expected = nominal_stress(law, mode, np.array(path))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("target", [name for name in FOAMS if name != "febio"])
def test_neo_hooke_goes_out_where_a_foam_equals_it_and_nowhere_else(target: str) -> None:
    law = NeoHooke(8e3, 0.0)
    energy, _ = READ[target](export(MaterialCard("rubber", law), target).text)
    assert stress(energy, "uniaxial", -0.6) == pytest.approx(float(nominal_stress(law, "uniaxial", -0.6)))
    with pytest.raises(ValueError, match="is another law than neo_hooke"):
        export(MaterialCard("rubber", NeoHooke(8e3, 0.3)), target)


@pytest.mark.parametrize("moduli", [None, "instantaneous", "longterm"])
@pytest.mark.parametrize("held", ["instantaneous", "longterm"])
@pytest.mark.parametrize("target", ["abaqus", "febio", "ansys"])
def test_relaxation_from_the_exported_numbers(target: str, held: str, moduli: str | None) -> None:
    """Stress after a step, G(t) x instantaneous stress, is the card's whatever moduli it holds and whichever go out."""
    law = TABLE_1 if held == "instantaneous" else replace(TABLE_1, mu_Pa=TABLE_1.mu_Pa * SERIES.g_infinity,
                                                          moduli="longterm")
    energy, series = READ[target](export(MaterialCard("x", law, SERIES), target, moduli).text)
    written = moduli or held
    if target == "ansys" and moduli == "longterm":
        assert not series
        return
    t = np.array([0.0, 0.3, 7.0, 500.0])
    if target == "febio":
        g0, *pairs = series
        shape = g0 + sum(g * np.exp(-t / tau) for g, tau in zip(pairs[::2], pairs[1::2], strict=True))
    else:
        shape = 1 - sum(g * (1 - np.exp(-t / tau)) for g, tau in zip(series[::2], series[1::2], strict=True))
        if target == "abaqus" and written == "longterm":
            shape = shape / SERIES.g_infinity
    expected = nominal_stress(TABLE_1, "uniaxial", np.array([-0.8]))[0] * relaxation(SERIES, t)
    np.testing.assert_allclose(stress(energy, "uniaxial", -0.8) * shape, expected, rtol=1e-10)


def test_abaqus_says_which_moduli_they_are() -> None:
    for moduli, word in (("instantaneous", "INSTANTANEOUS"), ("longterm", "LONG TERM")):
        assert keyword_blocks(export(CARD, "abaqus", moduli).text)["HYPERFOAM"][0]["MODULI"] == word
    assert "MODULI" not in keyword_blocks(export(MaterialCard("x", TABLE_1), "abaqus").text)["HYPERFOAM"][0]


def test_times_follow_the_units() -> None:
    _, series = read_ansys(export(CARD, "ansys", units="mm-kg-ms").text)
    np.testing.assert_allclose(series[1::2], SERIES.tau_s * 1e3, rtol=1e-15)


@pytest.mark.parametrize(("target", "pattern", "per_kg_m3"), [
    ("abaqus", r"\*DENSITY\n(\S+)", 1e-12), ("calculix", r"\*DENSITY\n(\S+)", 1e-12),
    ("febio", r"<density>(\S+)</density>", 1e-12), ("lsdyna", r"\n {19}1 +(\S+)", 1e-12),
    ("ansys", r"MP,DENS,1,(\S+)", 1e-12)])
def test_density_in_the_units(target: str, pattern: str, per_kg_m3: float) -> None:
    found = re.search(pattern, export(CARD, target, units="mm-t-s", density_kg_per_m3=28.5).text)
    assert found
    assert float(found[1]) == pytest.approx(28.5 * per_kg_m3, rel=1e-15)


@pytest.mark.parametrize("law", LAWS)
def test_keyword_lines_keep_their_limits(law: str) -> None:
    """Abaqus and CalculiX: eight values a line, 20 characters a value, 256 characters a line."""
    for target in ("abaqus", "calculix"):
        if not taken(target, LAWS[law]):
            continue
        text = export(MaterialCard(law, LAWS[law], SERIES), target, units="mm-kg-ms").text
        assert max(map(len, text.splitlines())) <= 256
        for _, rows in keyword_blocks(text).values():
            assert all(len(row) <= 8 and all(len(v) <= 20 for v in row) for row in rows)


@pytest.mark.parametrize("target", FOAMS)
def test_any_name_makes_a_readable_file(target: str) -> None:
    name = '--- 3 * foam & <"Schaum"> \u00e4, batch 7\n*BAD'
    energy, _ = READ[target](export(MaterialCard(name, TABLE_1), target).text)
    assert stress(energy, "uniaxial", -0.5) == pytest.approx(-4221.98, rel=1e-5)


@pytest.mark.parametrize("target", FOAMS)
def test_the_comment_says_what_is_written(target: str) -> None:
    skin = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
    deck = export(replace(CARD, conductivity=skin, provenance={"synthetic": True}), target, "longterm", "mm-t-s")
    text = " ".join(re.sub(r"^\W+", "", line) for line in deck.text.splitlines())
    for said in ("MPa", "long-term", "Skin conductivity", "30.0", "synthetic"):
        assert said in text
    for warning in deck.warnings:
        assert warning in text
    assert any("conductivity" in w for w in deck.warnings)
    assert any("Prony" in w or "convolves" in w for w in deck.warnings) or target == "febio"


def test_no_relaxation_no_warning() -> None:
    for target in ("abaqus", "calculix", "febio"):
        assert export(MaterialCard("x", TABLE_1), target).warnings == ()


def test_refusals_say_the_mend() -> None:
    compressible = MaterialCard("x", LAWS["one nu"])
    with pytest.raises(ValueError, match=r"beta = 0 only.*--poisson 0"):
        export(compressible, "febio")
    with pytest.raises(ValueError, match=r"one n \(beta\)"):
        export(MaterialCard("x", LAWS["nu per term"]), "lsdyna")
    with pytest.raises(ValueError, match=r"at most 3 .*--order 3"):
        export(MaterialCard("x", LAWS["six terms"]), "calculix")
    with pytest.raises(ValueError, match="no hyperelastic law"):
        export(MaterialCard("x", prony=SERIES), "abaqus")
    with pytest.raises(ValueError, match="no prony"):
        export(MaterialCard("x", TABLE_1), "abaqus", "longterm")
    with pytest.raises(ValueError, match="known: abaqus"):
        export(CARD, "nastran")
    with pytest.raises(ValueError, match="known: SI"):
        export(CARD, "abaqus", units="psi")
    with pytest.raises(ValueError, match="known: card, instantaneous"):
        export(CARD, "abaqus", "relaxed")
    with pytest.raises(ValueError, match="density must be positive"):
        export(CARD, "abaqus", density_kg_per_m3=float("nan"))
    with pytest.raises(ValueError, match="less than that of air"):
        export(CARD, "abaqus", units="mm-t-s", density_kg_per_m3=2.8e-11)
    with pytest.raises(ValueError, match="at most 6 Prony terms"):
        export(replace(CARD, prony=Prony([0.1] * 7, np.logspace(-2, 4, 7))), "febio")


@given(st.floats(allow_nan=False, allow_infinity=False).filter(lambda v: v == 0 or 1e-9 < abs(v) < 1e15))
def test_numbers_fit_their_columns(value: float) -> None:
    assert float(number(value)) == value
    text = number(value, 20)
    assert len(text) <= 20
    assert abs(float(text) - value) <= 2e-14 * abs(value)


def test_a_number_that_cannot_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="characters"):
        number(0.123456789012345, 6)


def test_command_line(tmp_path, command) -> None:
    def run(*arguments):
        return command("matcal", "export", *arguments)

    card = tmp_path / "card.json"
    card.write_text(json.dumps(as_json(CARD)))
    printed = run(card, "--to", "calculix", "--moduli", "longterm")
    assert printed.returncode == 0
    assert "warning: The Prony series is not exported" in printed.stderr
    out = tmp_path / "foam.inp"
    assert run(card, "--to", "CalculiX", "--moduli", "longterm", "--out", out).stdout == f"deck: {out}\n"
    assert out.read_text() == printed.stdout
    refused = run(card, "--to", "nastran")
    assert refused.returncode == 2
    assert "known: abaqus" in refused.stderr
    assert "Traceback" not in refused.stderr


@pytest.mark.parametrize("target", FOAMS)
@pytest.mark.parametrize(("units", "size"), [("SI", 1.0), ("mm-t-s", 1e-6)])
def test_a_deck_states_the_intervals_of_its_card(target: str, units: str, size: float) -> None:
    """As comments, in the units that are written, and with what the tests leave open; the input stays what it was."""
    rows = {"mu_0_Pa": {"value": 12e3, "sd": 500.0, "lo": 11e3, "hi": 13e3},
            "E_0_Pa": {"value": 24e3, "sd": 3e3, "lo": 10e3, "hi": 38e3}}
    plain = MaterialCard("foam", Hyperfoam([12e3], [2.0], [0.0], strain_range={"uniaxial": (-0.6, 0.0)}))
    card = replace(plain, fit={"derived": rows, "not_determined": ["E_0_Pa"],
                               "nu": {"how": "fit", "value": 0.0, "interval": [-0.01, 0.02], "bounds": [-0.4, 0.4999]}})
    with_it, without = export(card, target, units=units).text, export(plain, target, units=units).text
    (first,) = re.findall(r"mu_0 = (\S+) \S+ \[(\S+), (\S+)\]", with_it)
    np.testing.assert_allclose([float(v) for v in first], [12e3 * size, 11e3 * size, 13e3 * size])
    (second,) = re.findall(r"E_0 = .*", with_it)
    assert second.endswith("not determined by the tests")
    assert "nu = 0 [-0.01, 0.02]" in with_it
    added = [line for line in with_it.splitlines() if line not in without.splitlines()]
    assert all(line.lstrip().startswith(("**", "$", "!")) for line in added) or target == "febio"
    if target == "febio":
        xml.fromstring(with_it)
