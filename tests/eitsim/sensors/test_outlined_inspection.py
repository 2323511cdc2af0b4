"""`sensor inspect` with a skin that has an outline: order, numbering on the body, exchanged leads, what is refused."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from eitsim.electrics.outline.adapted_mesh import READINGS, solve_untouched
from eitsim.scene.drive import Drive, read_out
from eitsim.scene.edges.outline import Outline
from eitsim.scene.edges.outline_electrodes import along_edge
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import Body, Scene
from eitsim.sensors.inspection import Inspection, inspect
from eitsim.sensors.inspection_words import cautions, document, questions, rows
from eitsim.sensors.outlined_skin import on_body, outlined_skin, read_between
from eitsim.sensors.recognition import canonical
from eitsim.sensors.recording import Recording
from eitsim.sensors.sensor_file import Sensor, pairs_of

COUNT, SHEET_S = 16, 8e-4
RECTANGLE = Body(Outline("rectangle", width_m=0.12, height_m=0.08))
# an L whose hole is off its line of symmetry
UNEVEN = Body(Outline("polygon", points_m=((-0.06, -0.06), (0.06, -0.06), (0.06, 0.0), (0.0, 0.0), (0.0, 0.06),
                                           (-0.06, 0.06)), holes_m=((-0.015, -0.04, 0.01),)))


def described(body: Body, drive: Drive | None = None) -> Sensor:
    scene = Scene(body=body, electrodes=Electrodes(count=COUNT), drive=drive or Drive())
    return Sensor(scene.body, scene.skin, scene.electrodes, scene.drive)


@lru_cache(maxsize=4)
def impedance(body: Body) -> np.ndarray:
    """Of electrodes displaced by 0.5 mm whose contacts are off by 30 %."""
    rng, design = np.random.default_rng(3), described(body).electrodes
    positions = along_edge(body.outline, design) + 5e-4 * rng.standard_normal(COUNT)
    real = replace(design, shares=(), positions_m=tuple(positions),
                   contact_impedance_Ohm_m=tuple(np.exp(0.3 * rng.standard_normal(COUNT))))
    return solve_untouched(body.outline, real, SHEET_S, READINGS).impedance_Ohm


def inspected(body: Body, numbered: np.ndarray | None = None, drive: Drive | None = None,
              own: Drive | None = None, roll: int = 0, electrodes: Electrodes | None = None) -> Inspection:
    """Of a drive's readings with noise 60 dB below, electrode k of them being number numbered[k] on the body, and
    beginning so many readings later than that drive says; own, electrodes: those of the sensor file."""
    rng, to = np.random.default_rng(5), np.arange(COUNT) if numbered is None else numbered
    clean = read_out(drive or Drive(), impedance(body)[np.ix_(to, to)])
    clean = np.roll(clean, roll, axis=1).ravel()
    frames = clean + 1e-3 * np.sqrt(np.mean(clean**2)) * rng.standard_normal((5, clean.size))
    sensor = described(body, own)
    return inspect(Recording(frames, np.arange(5), None, np.array([""] * 5), "voltage", Path("frames.csv")),
                   replace(sensor, electrodes=electrodes or sensor.electrodes))


@pytest.mark.thorough
def test_a_rectangle_s_order_is_confirmed_and_its_symmetries_are_asked() -> None:
    found = inspected(RECTANGLE)
    assert found.identified.decided_by == "skin"
    assert found.agrees is True
    assert found.identified.unexplained < 2e-3
    assert set(found.placements) == {(1, 0), (1, 8), (-1, 0), (-1, 8)}
    assert found.placed is None
    (asked,) = questions(found)
    assert "4 numberings fit the untouched frame" in asked
    assert "Press where the file puts electrode 0, then where it puts 1, and run `eitsim reconstruct`" in asked
    assert not list(cautions(found))
    assert dict(rows(found))["decided by"] == "a homogeneous skin of the sensor file's outline"


def test_reciprocity_is_checked() -> None:
    drive = Drive(reading="differential")
    found = inspected(RECTANGLE, drive=drive, own=drive)
    assert found.agrees is True
    assert 0 < document(found)["reciprocity"]["together"] < 0.01


@pytest.mark.thorough
def test_a_skin_without_symmetries_says_which_electrode_is_which() -> None:
    found = inspected(UNEVEN)
    assert found.agrees is True
    assert found.placed == (1, 0)
    assert not list(questions(found))


def test_a_mirrored_outline_is_named() -> None:
    """Electrode 0 of the readings is the file's electrode 3, and they count the other way round."""
    found = inspected(UNEVEN, (3 - np.arange(COUNT)) % COUNT)
    assert found.agrees is True
    assert found.placed == (-1, 3)
    (said,) = cautions(found)
    assert "with electrode 0 at electrode 3 of the file, counting the other way round" in said
    assert document(found)["placed_on_body"] == {"way": -1, "turn": 3}
    assert "the electrodes' places do not" in dict(rows(found))["sensor file"]


@pytest.mark.thorough
@pytest.mark.parametrize("way", [1, -1])
def test_places_in_the_order_of_the_readings_repair_what_is_named(way: int) -> None:
    numbered = (3 + way * np.arange(COUNT)) % COUNT
    (said,) = cautions(inspected(UNEVEN, numbered))
    described_mm = 1e3 * along_edge(UNEVEN.outline, described(UNEVEN).electrodes)[numbered]
    assert f"positions_mm = [{', '.join(f'{one:.6g}' for one in described_mm[:4])}, ...]" in said
    listed = replace(described(UNEVEN).electrodes, positions_m=tuple(1e-3 * described_mm))
    found = inspected(UNEVEN, numbered, electrodes=listed)
    assert found.placed == (1, 0)
    assert dict(rows(found))["sensor file"] == "agrees with the readings"
    assert not list(cautions(found))


@pytest.mark.parametrize("case", [{"drive": Drive(pattern="skip-1")}, {"roll": 4}])
def test_another_order_than_the_sensor_file_s_contradicts_it(case: dict) -> None:
    found = inspected(RECTANGLE, **case)
    assert found.agrees is False
    order = found.identified.order
    assert order is not None
    if "drive" in case:
        true = pairs_of(described(RECTANGLE, case["drive"]))
        assert canonical(order.pairs, COUNT, True) == canonical(true, COUNT, True)
    said = next(cautions(found))
    assert "The readings contradict [drive] of the sensor file" in said
    assert ('pattern = "skip-1" with reading = "single-ended"' if "drive" in case else "by pairs in [drive]") in said


def test_a_board_that_reads_neighbours_is_named_as_the_sensor_file_names_it() -> None:
    found = inspected(RECTANGLE, drive=Drive(reading="differential"))
    assert found.agrees is False
    assert ('The first is pattern = "adjacent" with reading = "differential" in [drive], where "single-ended" is the '
            "default.") in next(cautions(found))


def test_a_dead_electrode_that_reads_noise_is_named() -> None:
    drive, rng = Drive(reading="differential"), np.random.default_rng(6)
    sensor, to = described(UNEVEN, drive), (3 - np.arange(COUNT)) % COUNT
    clean = read_out(drive, impedance(UNEVEN)[np.ix_(to, to)]).ravel()
    clean[(pairs_of(sensor) == 5).any(axis=1)] = 0.0
    frames = clean + 1e-3 * np.sqrt(np.mean(clean**2)) * rng.standard_normal((5, clean.size))
    found = inspect(Recording(frames, np.arange(5), None, np.array([""] * 5), "voltage", Path("frames.csv")), sensor)
    assert found.agrees is True
    assert found.dead_electrodes == (5,)
    assert any("Electrode 5 is dead" in one for one in cautions(found))


@pytest.mark.thorough
def test_exchanged_leads_are_named() -> None:
    leads = np.arange(COUNT)
    leads[[3, 4]] = 4, 3
    assert inspected(UNEVEN, leads).identified.swapped == (3, 4)


def test_electrodes_on_the_surface_are_inspected_too() -> None:
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(-0.045, 0.045, 4), np.linspace(-0.025, 0.03, 3)))
    scene = Scene(body=RECTANGLE, electrodes=Electrodes(
        kind="surface", count=12, x_m=tuple(x), y_m=tuple(y), width_m=0.006, contact_impedance_Ohm_m2=1e-4))
    one = Sensor(scene.body, scene.skin, scene.electrodes, scene.drive)
    rest = solve_untouched(RECTANGLE.outline, one.electrodes, SHEET_S, READINGS).impedance_Ohm
    clean = read_out(one.drive, rest).ravel()
    found = inspect(Recording(clean[None], np.array([0]), None, np.array([""]), "voltage", Path("frames.csv")), one)
    assert found.agrees is True
    assert (1, 0) in found.placements


def test_readings_of_a_numbering_are_those_of_the_impedance_matrix_so_numbered() -> None:
    z, pairs = impedance(UNEVEN), pairs_of(described(UNEVEN))
    to = (2 - np.arange(COUNT)) % COUNT
    expected = read_out(Drive(current_A=1.0), z[np.ix_(to, to)]).ravel()
    np.testing.assert_allclose(read_between(z, on_body(pairs, (-1, 2), COUNT)), expected, atol=1e-9 * np.abs(z).max())


def test_electrodes_without_contact_are_refused_by_name() -> None:
    with pytest.raises(ValueError, match=r"missing in .electrodes.; leave it out, and leave the cells"):
        outlined_skin(RECTANGLE, replace(described(RECTANGLE).electrodes, missing=(2,)))
