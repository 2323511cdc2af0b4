"""The limit over the disc: standard deviations of x0, y0, d and F of one punch, by its place.

Places of one sector from an electrode to the next are solved; the ring's turns make them the whole disc's, and turn the
covariance of the place with them. (Its mirror is no symmetry of the readings: see `derivative_table`.) On an outline
nothing turns, and places lie all over it.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from eitsim.scene.electrodes import identical
from eitsim.scene.polygons import centroid_m
from eitsim.scene.scene import Punch, Scene
from eitsim.sensors.layout.touch_slopes import outline_places_m
from eitsim.sweeps.measurement.instrument import below
from matcal.card import MaterialCard
from surrogate.bounds.fisher_information import correlation, information
from surrogate.bounds.material_spread import MaterialSpread, known_material
from surrogate.bounds.reading_derivatives import Derivatives, derivatives_of, slopes_of
from surrogate.data import outputs
from surrogate.data.sensor_ring import ring_of
from surrogate.statistics.metrics import rms
from touchcal.arrays import Array

# Distances from the centre, the centre aside, which lie closer towards the rim, and angles of a sector.
RADII, ANGLES = 8, 4
OUTLINED = 60  # places over an outline, which no turn makes more
# Least distance of the punch's edge from the rim, over the radius of the disc; the skin's mesh refines towards none.
GAP = 0.01


@dataclass(frozen=True, eq=False)
class Solved:
    """Derivatives of the readings by a touch at one place."""

    radius_mm: float
    angle: float
    derivatives: Derivatives


def places(scene: Scene, radii: int = RADII, angles: int = ANGLES) -> list[tuple[float, float]]:
    """Radius, mm, and angle, rad, of the places of a sector: the centre, then out to GAP from the rim; on an outline as
    many all over the skin, from its centroid outwards.

    ValueError where the sensor has no such sectors or the scene not one punch.
    """
    if len(scene.punches) != 1:
        raise ValueError(f"a map is that of one punch; the scene has {len(scene.punches)}. Give one [punch].")
    if scene.body.has_outline:
        x, y = 1e3 * outline_places_m(scene, OUTLINED).T
        order = np.argsort(np.hypot(*(np.column_stack([x, y]) - 1e3 * centroid_m(scene.body.outline)).T))
        return list(zip(np.hypot(x, y)[order].tolist(), np.arctan2(y, x)[order].tolist(), strict=True))
    if not _turns(scene):
        raise ValueError("the sensor does not look the same from each electrode to the next, and a map is solved in "
                         "one sector. Give equal, evenly spaced electrodes and a named pattern.")
    reach = ((1 - GAP) * scene.body.radius_m - scene.punches[0].diameter_m / 2) * 1e3
    radius = reach * np.sin(np.pi / 2 * np.arange(1, radii + 1) / radii)
    angle = 2 * np.pi / scene.electrodes.count * np.arange(angles) / angles
    return [(0.0, 0.0), *((float(r), float(a)) for r in radius for a in angle)]


def _turns(scene: Scene) -> bool:
    """Whether turning a sensor by one electrode gives the same readings, in another order."""
    ring, count = ring_of(scene), scene.electrodes.count
    readings = np.stack([ring.source, ring.sink, ring.read, ring.ground], axis=1)
    return identical(scene.electrodes) and set(map(tuple, readings)) == set(map(tuple, (readings + 1) % count))


def solved(scene: Scene, card: MaterialCard, where: Iterable[tuple[float, float]], *,
           rim: bool = False) -> Iterator[Solved]:
    """The scene's punch at places of a sector, some 1.5 CPU seconds each; errors as `derivatives_of`."""
    for radius, angle in where:
        x_mm, y_mm = radius * float(np.cos(angle)), radius * float(np.sin(angle))
        there = replace(scene.punches[0], x_m=x_mm / 1e3, y_m=y_mm / 1e3)
        yield Solved(radius, angle, derivatives_of(replace(scene, punches=(there,)), card, rim=rim))


def turned(covariance: Array, angle: float) -> Array:
    """(4, 4) covariance of (x, y, d, F) of a touch turned about the centre."""
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return turn @ covariance @ turn.T


def over_disc(scene: Scene, card: MaterialCard, spreads: Mapping[str, MaterialSpread], noise_db: Sequence[float], *,
              rim: bool = False, each: Callable[[Iterable[int]], Iterable[int]] = iter) -> pd.DataFrame:
    """Standard deviations of the scene's punch anywhere on the skin, one row a noise level, material and place.

    spreads: name -> what is open of the material. Levels in dB below the RMS of the baseline voltages.
    """
    where = places(scene)
    found = list(solved(scene, card, (where[k] for k in each(range(len(where)))), rim=rim))
    count = scene.body.edge.turns(scene.electrodes)
    return pd.DataFrame([row for level in noise_db for name, spread in spreads.items() for one in found
                         for row in _turned_rows(scene.punches[0], one, spread, level, name, count)])


def _turned_rows(punch: Punch, one: Solved, spread: MaterialSpread, level: float, material: str,
                 count: int) -> Iterator[dict[str, object]]:
    """Rows of a place and of those that the ring's turns make of it."""
    own = covariance_at(one.derivatives, spread, level)
    for k in range(count if one.radius_mm else 1):
        turn = 2 * np.pi * k / count
        covariance = turned(own, turn)
        sd = np.sqrt(np.diag(covariance))
        yield {"noise_db": level, "noise_V": below(level, rms(one.derivatives.baseline_V)), "material": material,
               "x_mm": one.radius_mm * np.cos(one.angle + turn), "y_mm": one.radius_mm * np.sin(one.angle + turn),
               "d_mm": punch.diameter_m * 1e3, "F_N": punch.force_N, "sd_x0_mm": sd[0], "sd_y0_mm": sd[1],
               "sd_d_mm": sd[2], "sd_F_N": sd[3], "correlation_d_F": float(correlation(covariance, "d", "F"))}


def cramer_rao(scene: Scene, card: MaterialCard, noise_dB: Sequence[float] = (80.0, 60.0),
               spreads: Mapping[str, MaterialSpread] | None = None, *, rim: bool = False) -> pd.DataFrame:
    """Least standard deviations that an unbiased reading of one touch can have under white noise.

    Parameters
    ----------
    scene : Scene
        A scene of one punch.
    card : MaterialCard
        Foam and skin.
    noise_dB : sequence of float
        Levels of noise, dB below the RMS of the baseline voltages.
    spreads : mapping, optional
        Name -> what is open of the material; the material is known where left out.
    rim : bool
        Whether what the rim changes of the mechanics counts.

    Returns
    -------
    pandas.DataFrame
        One row a level, material and output x0, y0, d, F: `noise_db`, `noise_V`, `material`, `output`, `unit`,
        `limit` in that unit, `correlation_d_F`.

    Raises
    ------
    ValueError
        Where the scene has not one punch, or its drive is not that of pairs.

    Examples
    --------
    >>> found = surrogate.cramer_rao(eitsim.read_scene("scene.toml"), matcal.read_card("card.json"), rim=False)
    >>> found["output"].unique().tolist()
    ['x0', 'y0', 'd', 'F']
    """
    found = derivatives_of(scene, card, rim=rim)
    spreads = spreads or {"known": known_material()}
    return pd.DataFrame([row for level in noise_dB for name, spread in spreads.items()
                         for row in limits_of(found, spread, level, name)])


def covariance_at(found: Derivatives, spread: MaterialSpread, noise_db: float) -> Array:
    """(..., 4, 4) Cramer-Rao covariance of (x, y, d, F), mm and N, under noise in dB below the RMS of the baseline."""
    noise_V = below(noise_db, rms(found.baseline_V))
    return np.asarray(np.linalg.inv(information(slopes_of(found, spread), noise_V)), np.float64)


def limits_of(found: Derivatives, spread: MaterialSpread, noise_db: float, material: str) -> list[dict[str, Any]]:
    """One row an output: its standard deviation, and the correlation of d and F."""
    covariance = covariance_at(found, spread, noise_db)
    sd, noise_V = np.sqrt(np.diag(covariance)), below(noise_db, rms(found.baseline_V))
    return [{"noise_db": noise_db, "noise_V": noise_V, "material": material, "output": name,
             "unit": outputs.of(name).unit, "limit": float(sd[k]),
             "correlation_d_F": float(correlation(covariance, "d", "F"))}
            for k, name in enumerate(outputs.TOUCHES)]
