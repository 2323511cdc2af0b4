"""Bounds by drive and choice of readings: slopes of any pairs from one solution, a greedy choice of readings."""

import itertools
import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest

from eitsim.electrics.mesh.p2_triangles import HALVINGS
from eitsim.scene.drive import Drive
from eitsim.scene.edges.outline import Outline
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.polygons import edge_distance_m
from eitsim.scene.scene import Accuracy, Body, Punch, Scene
from eitsim.sensors.layout.reading_choice import bounds, chosen
from eitsim.sensors.layout.sensor_design import design_sensor
from eitsim.sensors.layout.touch_slopes import (
    UNKNOWNS,
    TouchSlopes,
    outline_places_m,
    reading_slopes,
    touch_slopes,
    untouched_V,
)
from eitsim.sensors.sensor_file import Sensor, pairs_of, read_sensor
from eitsim.simulation.derivatives.readings import scene_sensitivity
from matcal.card import MaterialCard, write_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

CARD = MaterialCard("Table 1", Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm"),
                    None, Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
SCENE = Scene(electrodes=Electrodes(count=8), drive=Drive(pattern="skip-1"), punches=(Punch(force_N=0.5),))
PLACES = 2


@pytest.fixture(scope="module")
def slopes() -> TouchSlopes:
    return touch_slopes(SCENE, CARD, places=PLACES)


def solved(place_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives and untouched readings of the scene's own drive, solved there."""
    punch = replace(SCENE.punches[0], x_m=place_mm[0] / 1e3, y_m=place_mm[1] / 1e3)
    found = scene_sensitivity(replace(SCENE, punches=(punch,), accuracy=Accuracy(math.inf)), CARD,
                              halvings=HALVINGS - 1)
    columns = [found.parameters.index(name) for name in UNKNOWNS]
    return found.signal_by[:, columns], found.touched_V - found.signal_V


def own_pairs(scene: Scene) -> np.ndarray:
    return pairs_of(Sensor(scene.body, scene.skin, scene.electrodes, scene.drive))


@pytest.mark.thorough
def test_slopes_of_pairs_are_those_of_their_drive(slopes: TouchSlopes) -> None:
    by, before = solved(slopes.place_mm[1])
    pairs = own_pairs(SCENE)
    assert np.abs(reading_slopes(slopes, pairs)[1] - by).max() < 1e-9 * np.abs(by).max()
    assert np.abs(untouched_V(slopes, pairs) - before).max() < 1e-9 * np.abs(before).max()


def test_a_turned_place_has_the_slopes_that_are_solved_there(slopes: TouchSlopes) -> None:
    """On another mesh, so to its error."""
    row = PLACES * 3 + 1
    by, _ = solved(slopes.place_mm[row])
    assert not np.allclose(slopes.place_mm[row], slopes.place_mm[1])
    missed = np.linalg.norm(reading_slopes(slopes, own_pairs(SCENE))[row] - by, axis=0)
    assert np.all(missed < 0.01 * np.linalg.norm(by, axis=0))


SKIN = Body(Outline("rectangle", width_m=0.12, height_m=0.08, holes_m=((0.04, 0.0, 0.006),)), 0.005)
OUTLINED = Scene(SKIN, (Punch(diameter_m=0.010, force_N=0.2),), electrodes=Electrodes(count=8, width_m=0.008),
                 drive=Drive(pattern="skip-1"))


@pytest.mark.thorough
def test_on_an_outline_places_keep_from_edges_holes_and_electrodes_and_none_is_turned() -> None:
    found = touch_slopes(OUTLINED, CARD, places=1)
    assert found.place_mm.shape == (1, 2)
    there = replace(OUTLINED.punches[0], x_m=found.place_mm[0, 0] / 1e3, y_m=found.place_mm[0, 1] / 1e3)
    solved_there = scene_sensitivity(replace(OUTLINED, punches=(there,), accuracy=Accuracy(math.inf)), CARD,
                                     halvings=HALVINGS - 1)
    by = solved_there.signal_by[:, [solved_there.parameters.index(name) for name in UNKNOWNS]]
    pairs = own_pairs(OUTLINED)
    assert np.abs(reading_slopes(found, pairs)[0] - by).max() < 1e-8 * np.abs(by).max()
    grid = Electrodes(kind="surface", count=4, x_m=(-0.03, 0.02, 0.02, -0.03), y_m=(-0.02, -0.02, 0.02, 0.02),
                      width_m=0.006, shape="disc", contact_impedance_Ohm_m2=1e-4)
    for electrodes in (OUTLINED.electrodes, grid):
        at = outline_places_m(replace(OUTLINED, electrodes=electrodes), 100)
        assert at.shape == (100, 2)
        assert edge_distance_m(SKIN.outline, at).min() > 0.006
        quarters = np.unique((at > 0) @ [1, 2], return_counts=True)[1]
        assert quarters.min() > 15
        if electrodes.kind == "surface":
            middles = np.column_stack([grid.x_m, grid.y_m])
            assert np.linalg.norm(at[:, None] - middles, axis=-1).min() > 0.009
    assert np.linalg.norm(outline_places_m(OUTLINED, 50, 0.02), axis=1).max() < 0.02
    with pytest.raises(ValueError, match="finds no place"):
        touch_slopes(replace(OUTLINED, punches=(Punch(diameter_m=0.09, force_N=0.2),)), CARD)


@pytest.mark.slow
def test_on_an_outline_drives_are_rated_and_readings_chosen() -> None:
    found = design_sensor(OUTLINED, CARD, readings=12, places=6)
    assert found.places == 6
    assert found.drives[0].over_own <= 1
    assert found.choice is not None
    assert found.choice.readings == 12
    assert np.all(found.choice.median > found.drives[-1].median * 0.1)


def test_each_reading_taken_adds_most_to_the_log_det() -> None:
    rng = np.random.default_rng(0)
    by, before = rng.standard_normal((5, 12, 3)), np.array([2.0, 3.0, 0.5])
    order = chosen(by, 6, before)
    assert len(set(order.tolist())) == 6

    def log_det(rows: list[int]) -> float:
        part = by[:, rows]
        return float(np.linalg.slogdet(np.diag(before**-2.0) + part.transpose(0, 2, 1) @ part)[1].mean())

    for k in range(6):
        rest = [r for r in range(12) if r not in order[:k]]
        assert order[k] == max(rest, key=lambda r: log_det([*order[:k], r]))


def test_bounds_are_the_roots_of_the_inverse_information() -> None:
    by = np.random.default_rng(1).standard_normal((4, 9, 3)) * [1.0, 1e3, 1e-3]
    expected = [np.sqrt(np.diag(np.linalg.inv(one.T @ one))) for one in by]
    assert np.allclose(bounds(by), expected, rtol=1e-8)
    assert np.all(np.isinf(bounds(by[:, :2])).any(axis=1))


@pytest.mark.thorough
def test_a_choice_beats_chance_and_all_readings_beat_it(slopes: TouchSlopes) -> None:
    scene = replace(SCENE, drive=Drive())
    design = design_sensor(scene, CARD, readings=12, places=PLACES)
    assert design.choice is not None
    own = own_pairs(scene)
    assert {tuple(one) for one in design.pairs.tolist()} <= {tuple(one) for one in own.tolist()}
    by = reading_slopes(slopes, own)[..., :3] / design.noise_V
    rng = np.random.default_rng(0)
    by_chance = [np.log(bounds(by[:, rng.permutation(len(own))[:12]]) / bounds(by)).mean() for _ in range(20)]
    assert 1 < design.choice.over_own < np.exp(min(by_chance))
    ratios = [one.over_own for one in design.drives]
    assert ratios == sorted(ratios)
    assert next(one for one in design.drives if one.name == "own drive").over_own == 1
    free = design_sensor(scene, CARD, readings=12, candidates="all", places=PLACES)
    assert free.choice is not None
    assert free.choice.over_own < design.choice.over_own


@pytest.mark.thorough
def test_an_unknown_diameter_widens_every_bound() -> None:
    known, unknown = (design_sensor(SCENE, CARD, places=1, unknown_diameter=one).drives for one in (False, True))
    for one in known:
        other = next(each for each in unknown if each.name == one.name)
        assert np.all(other.median[:3] >= one.median * (1 - 1e-9))
    assert any(np.all(o.median[2] > 1.01 * k.median[2]) for k, o in itertools.product(known, unknown)
               if k.name == o.name)


@pytest.mark.parametrize(("scene", "given", "named"), [
    (replace(SCENE, punches=(Punch(depth_m=1e-3),)), {}, "force_N"),
    (replace(SCENE, electrodes=Electrodes(count=8, missing=(2,))), {}, "missing"),
    (SCENE, {"within_m": 0.2}, "200 mm"),
    (SCENE, {"readings": 2}, "2 readings"),
    (SCENE, {"readings": 9, "candidates": "some"}, "own, all"),
    (SCENE, {"noise_V": 0.0}, "above 0 V")])
def test_what_cannot_be_designed_is_refused(scene: Scene, given: dict[str, float], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        design_sensor(scene, CARD, **given)


def test_the_command_writes_pairs_that_a_sensor_file_names(command: Callable[..., CompletedProcess[str]],
                                                           tmp_path: Path) -> None:
    write_card(CARD, tmp_path / "card.json")
    (tmp_path / "sensor.toml").write_text("[electrodes]\ncount = 6\n")
    words = ("sensor", "design", "sensor.toml", "--card", "card.json", "--places", "1")
    done = command("eitsim", *words, "--readings", "8", "--out", "pairs.csv", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)["sensors"][0]
    (tmp_path / "less.toml").write_text('[electrodes]\ncount = 6\n[drive]\npairs = "pairs.csv"\n')
    assert pairs_of(read_sensor(tmp_path / "less.toml")).tolist() == found["choice"]["pairs"]
    assert len(found["choice"]["pairs"]) == 8
    assert command("eitsim", *words, "--out", "pairs.csv", cwd=tmp_path).returncode == 2
