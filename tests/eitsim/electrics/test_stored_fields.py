"""Stored fields: the values of the skin's own functions on one grid, whole files beside whole parts, told damage."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from eitsim.electrics.forward.gridded_fields import (
    QUANTITIES,
    StoredFields,
    coordinates,
    fields_from,
    inside,
    places,
    values,
)
from eitsim.electrics.forward.sheet_fields import contact_pressure, surface_displacement
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.results import RimField, Touch
from eitsim.scene.scene import Body, Punch, Scene, Skin
from eitsim.sheet.sheet_conductance import sheet_conductance, stretches, surface_metric, touched_conductance
from eitsim.sweeps.dataset.hdf5_fields import encoded, joined
from matcal.laws.conductivity import Conductivity, conductivity
from matcal.laws.hyperfoam import Hyperfoam

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0])
LAW = Conductivity(30.0, [-2, 2, -1], (0.0, 0.4))
PUNCH = Punch(0.02, -0.01, force_N=0.5)
ALL = tuple(QUANTITIES)
FINE = fields_from({"names": list(ALL), "side": 160})


@pytest.fixture(scope="module")
def touch() -> Touch:
    return solve_touch(FOAM, Body(), PUNCH, element_m=0.2e-3)


@pytest.fixture(scope="module", params=["square", "polar"])
def stored(request) -> StoredFields:
    sizes = {"side": 160} if request.param == "square" else {"rings": 70, "angles": 90}
    return fields_from({"names": list(ALL), "grid": request.param, **sizes})


def test_values_are_those_of_the_skin_at_the_points(touch: Touch, stored: StoredFields) -> None:
    """One touch: stretches along its radius; at least 30 points lie in the contact."""
    scene = Scene(punches=(PUNCH,))
    found, there = values(stored, scene, [touch], LAW), inside(stored, scene.body)
    points = places(stored, scene.body)[there]
    radius = np.hypot(points[:, 0] - PUNCH.x_m, points[:, 1] - PUNCH.y_m)
    assert np.sum(radius < touch.contact_radius_m) >= 30
    meridian, hoop, _ = stretches(touch, radius)
    strain = np.maximum(meridian, hoop) - 1
    assert found["strain"][there] == pytest.approx(strain, abs=1e-6)
    assert found["strain"][there].max() > 0.05
    assert found["conductivity"][there] == pytest.approx(conductivity(LAW, strain) / 30.0 - 1, abs=1e-6)
    sheet = sheet_conductance(points, PUNCH, touch, scene.skin, LAW)
    for part, (i, j) in enumerate([(0, 0), (1, 1), (0, 1)]):
        assert found["conductance"][there][:, part] == pytest.approx(sheet[:, i, j], rel=1e-6, abs=1e-10)
    assert found["pressure"][there] * 1e3 == pytest.approx(contact_pressure(points, ((PUNCH, touch),)), rel=1e-6)
    assert found["displacement"][there] / 1e3 == pytest.approx(
        surface_displacement(points, ((PUNCH, touch),))[:, 2], rel=1e-6, abs=1e-12)
    assert all(np.isnan(field[~there]).all() for field in found.values())


@pytest.mark.parametrize("strain", ["normal", "areal"])
def test_the_strain_is_the_one_that_drives_the_skin(touch: Touch, strain: str) -> None:
    scene = Scene(punches=(PUNCH,), skin=Skin(strain=strain))
    found, there = values(FINE, scene, [touch], LAW), inside(FINE, scene.body)
    points = places(FINE, scene.body)[there]
    meridian, hoop, normal = stretches(touch, np.hypot(points[:, 0] - PUNCH.x_m, points[:, 1] - PUNCH.y_m))
    wanted = normal - 1 if strain == "normal" else meridian * hoop - 1
    assert found["strain"][there] == pytest.approx(wanted, abs=1e-6)


def test_touches_near_the_rim_and_several_of_them(touch: Touch) -> None:
    """Beside a touch that a rim changes lies another; the conductance is what the readings are solved with."""
    body, near, other = Body(), Punch(0.085, 0.01), Punch(-0.03, 0.01)
    circles, shares = np.linspace(1e-3, 30e-3, 15), np.linspace(0, 1, 7)
    field = np.ones((15, 7))
    towards = np.cos(np.pi * shares) * np.ones((15, 1))
    rim = RimField(circles, shares, 1e-4 * np.stack([towards, 0 * field, field], axis=-1),
                   np.stack([field + 0.01 * towards, 0 * field, field], axis=-1), field + 0.02 * towards,
                   body.radius_m, float(np.hypot(0.085, 0.01)))
    pairs = ((near, replace(touch, rim=rim)), (other, touch))
    scene = Scene(punches=(near, other), skin=Skin(strain="normal"))
    found, there = values(FINE, scene, [one for _, one in pairs], LAW), inside(FINE, body)
    points = places(FINE, body)[there]
    sheet = touched_conductance(points, pairs, scene.skin, LAW)
    for part, (i, j) in enumerate([(0, 0), (1, 1), (0, 1)]):
        assert found["conductance"][there][:, part] == pytest.approx(sheet[:, i, j], rel=1e-6, abs=1e-10)
    assert found["displacement"][there] == pytest.approx(surface_displacement(points, pairs)[:, 2] * 1e3, rel=1e-6)
    at_near = np.linalg.norm(points - [near.x_m, near.y_m], axis=1)
    both = surface_metric(points, *pairs[0])[1] * surface_metric(points, *pairs[1])[1]
    assert found["strain"][there] == pytest.approx(both - 1, abs=1e-6)
    alone = values(FINE, scene, [touch, touch], LAW)["strain"][there]
    apart = np.abs(found["strain"][there] - alone)
    assert apart[at_near < 0.02].max() > 0.005
    assert apart[at_near > 0.031].max() < 1e-6


def test_grids_lie_on_the_disc() -> None:
    body = Body()
    square = fields_from({"names": ["strain"], "side": 5})
    assert coordinates(square, body)["x_mm"] == pytest.approx([-80, -40, 0, 40, 80])
    assert places(square, body)[1, 3] == pytest.approx([0.04, -0.04])
    assert inside(square, body).sum() == 21
    polar = fields_from({"names": ["strain"], "grid": "polar", "rings": 4, "angles": 8})
    assert coordinates(polar, body)["radius_mm"].tolist() == [12.5, 37.5, 62.5, 87.5]
    assert places(polar, body)[3, 2] == pytest.approx([0.0, 0.0875])
    assert inside(polar, body).all()


def test_a_file_tells_units_and_joins_with_the_next(tmp_path: Path, touch: Touch) -> None:
    stored, scene = fields_from({"names": list(ALL), "side": 12}), Scene(punches=(PUNCH,))
    found = values(stored, scene, [touch], LAW)
    first = encoded(stored, scene.body, {4: found, 5: {}, 6: found})
    whole = joined(stored, scene.body, [first, encoded(stored, scene.body, {6: {}, 7: found})])
    (tmp_path / "a.h5").write_bytes(whole)
    with h5py.File(tmp_path / "a.h5") as file:
        contents = {name: (values[()], dict(values.attrs)) for name, values in file.items()}
    assert contents["scene"][0].tolist() == [4, 5, 6, 7]
    assert contents["contact_pressure_kPa"][1]["units"] == "kPa"
    assert contents["sheet_conductance_S"][0].shape == (4, 12, 12, 3)
    strain = contents["driving_strain"][0]
    assert strain.dtype == np.float32
    assert np.array_equal(strain[0], found["strain"], equal_nan=True)
    assert np.array_equal(strain[3], found["strain"], equal_nan=True)
    assert np.isnan(strain[1:3]).all()
    assert whole == encoded(stored, scene.body, {4: found, 5: {}, 6: {}, 7: found})


@pytest.mark.parametrize(("raw", "says"), [
    ({}, "names in .fields. must be a list of some of strain, conductivity, conductance, pressure, displacement"),
    ({"names": ["temperature"]}, r"got \['temperature'\]"),
    ({"names": ["strain"], "grid": "hex"}, "known: square, polar"),
    ({"names": ["strain"], "rings": 4}, "rings in .fields. has no effect with grid = \"square\""),
    ({"names": ["strain"], "grid": "polar", "angles": 1}, "whole number from 2 to 1,024"),
    ({"names": ["strain"], "pixels": 4}, "unknown key 'pixels'"), (["strain"], "must be a table")])
def test_wrong_keys_are_told_with_the_mend(raw, says) -> None:
    with pytest.raises(ValueError, match=says):
        fields_from(raw)
