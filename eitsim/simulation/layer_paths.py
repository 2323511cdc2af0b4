"""Touches of a layer with their insides along paths of forces, and between these: what a fit to presses takes.

On one mesh a punch's touches are smooth in the logarithm of the depth: cubics of it give the logarithm of the force and
all displacements over the depth. Moduli of a layer on a rigid plate times a factor are that factor of all forces; on a
soft base, which keeps its own, paths are solved at a few factors, and touches at one force, or depth, are polynomials
of the factor's logarithm.
"""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from eitsim.mechanics.axisymmetric.solve_axisymmetric import at_depth, force_unit, mesh_hierarchy, solved_along
from eitsim.mechanics.load_paths.table import lagrange_weights
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch, Scene
from eitsim.simulation.choose import without_edges
from eitsim.simulation.material import Material
from matcal.laws.law import Law, scaled
from touchcal.arrays import Array
from touchcal.errors import NotConverged
from touchcal.parallel.one_thread import ONE_THREAD

# A path's force over the one before; touches of a path, at least; and how far it goes beyond the least and the largest
# depth, or force: on a rigid plate other moduli are other forces.
_RATIO, _FEWEST, _MARGIN, _MARGIN_ON_BASE, _LITTLE = 1.3, 5, 1.8, 1.3, 1.02
_DEEPEST = 0.8  # Depth over the thickness of all at which a path ends: equilibria that are deeper take long.
_COARSER = 1.5  # Element size over the default one: it leaves 0.1 % of the signal, in half the time.
# Logarithms of the factors at which paths are solved on a soft base, and as far as which they serve.
_FACTORS, _REACH = (-0.45, -0.15, 0.15, 0.45), 0.6
# Of a touch what is interpolated over its depth, all 0 where nothing is touched, and stretches, which are then 1.
_FIELDS = ("u_r_m", "u_z_m", "contact_radius_m", "pressure_Pa", "sigma_max_Pa", "sigma_ave_Pa", "contact_area_m2",
           "wall_contact_m2")
_STRESSES = ("pressure_Pa", "sigma_max_Pa", "sigma_ave_Pa")
_STRETCHES = ("stretch_meridian", "stretch_hoop", "stretch_normal")


@dataclass(frozen=True, eq=False)
class LayerPath:
    """One punch's touches at increasing forces."""

    like: Touch  # the last one
    ln_depth: Array  # (n,) of m, increasing
    rows: CubicSpline  # by ln_depth: the logarithm of the force, N, and `_row`

    def at(self, punch: Punch) -> float | None:
        """ln_depth under a punch's force or at its depth; None where the path does not reach it."""
        low, high = self.ln_depth[0], self.ln_depth[-1]
        if punch.depth_m is not None:
            found = math.log(punch.depth_m)
            return found if low <= found <= high else None
        assert punch.force_N is not None
        force = math.log(punch.force_N)
        if not self.rows(low)[0] <= force <= self.rows(high)[0]:
            return None
        return float(brentq(lambda at: float(self.rows(at)[0]) - force, low, high))  # pyright: ignore[reportArgumentType]


@dataclass(frozen=True, eq=False)
class LayerPaths:
    """Touches of a few punches on one layer."""

    law: Law  # the layer's, whose moduli times a factor serve too
    factors: tuple[float, ...]  # logarithms of the factors at which paths are solved
    paths: Mapping[float, tuple[LayerPath, ...]]  # diameter, m -> a path a factor

    def touch(self, scene: Scene, material: Material) -> Touch | None:
        """The touch of a scene's one punch; None where no path reaches it, or edges may change more of the signal than
        their share of the requested error."""
        (punch,), factor = scene.punches, math.log(material.law.mu_0_Pa / self.law.mu_0_Pa)
        alone = len(self.factors) == 1
        if not without_edges(scene, material) or (not alone and abs(factor) > _REACH):
            return None
        paths, stiffer = self.paths[punch.diameter_m], math.exp(factor) if alone else 1.0
        at = [one for path in paths if (one := path.at(_times(punch, force=1 / stiffer))) is not None]
        if len(at) < len(paths):
            return None
        weights = lagrange_weights(np.array(self.factors), 0.0 if alone else factor)
        found = weights @ np.array([np.append(one, path.rows(one)) for path, one in zip(paths, at, strict=True)])
        return _touch(paths[0].like, math.exp(found[0]), stiffer * math.exp(found[1]), found[2:], stiffer)


@ONE_THREAD
def layer_paths(scene: Scene, material: Material, punches: Sequence[Punch]) -> LayerPaths:
    """Paths for presses by punches, all of them to a force or all to a depth, as far as equilibria are found.

    NotConverged where none are found for a punch.
    """
    factors, paths = _FACTORS if material.base is not None else (0.0,), {}
    for diameter in sorted({punch.diameter_m for punch in punches}):
        own = sorted((punch for punch in punches if punch.diameter_m == diameter),
                     key=lambda punch: punch.depth_m or punch.force_N or 0.0)
        paths[diameter] = tuple(_path(replace(material, law=scaled(material.law, math.exp(one))), scene.body, own[0],
                                      own[-1]) for one in factors)
    return LayerPaths(material.law, factors, paths)


def _path(material: Material, body: Body, least: Punch, most: Punch) -> LayerPath:
    law, margin = material.solid, _MARGIN if material.base is None else _MARGIN_ON_BASE
    least, most = _times(least, 1 / margin, 1 / _LITTLE), _times(most, margin, _LITTLE)
    touches = [*_solved(law, body, least, most)]
    if len(touches) < 2:
        raise NotConverged(f"a punch of {1e3 * least.diameter_m:g} mm finds no equilibrium on a layer of "
                           f"{1e3 * body.layer_m:g} mm. Leave out its presses.")
    at = np.log([touch.depth_m for touch in touches])
    return LayerPath(touches[-1], at, CubicSpline(at, np.array([
        np.append(math.log(touch.force_N), _row(touch)) for touch in touches])))


def _solved(law: Law, body: Body, least: Punch, most: Punch) -> Iterator[Touch]:
    """Touches from one punch's force or depth to the other's, or until none is found or it is too deep."""
    first, most_N, most_m = _force_N(law, body, least), most.force_N or math.inf, most.depth_m or math.inf
    ratio = min(_RATIO, (most_N / first) ** (1 / (_FEWEST - 1)))
    forces = (first * ratio**k for k in itertools.count())
    found = solved_along(law, body, replace(least, depth_m=None, force_N=first), forces,
                         element_m=_COARSER * default_element_m(body, least))
    try:
        for count, touch in enumerate(found, 1):
            if touch.depth_m > _DEEPEST * body.thickness_m:
                return
            yield touch
            if count >= _FEWEST and (touch.force_N >= most_N * (1 - 1e-9) or touch.depth_m >= most_m):
                return
    except NotConverged:
        return


def _force_N(law: Law, body: Body, punch: Punch) -> float:
    """The force on a punch, N; of one at a depth roughly, by the coarsest mesh."""
    if punch.force_N is not None:
        return punch.force_N
    assert punch.depth_m is not None
    coarse = mesh_hierarchy(law, body, punch, None, None)[:1]
    return at_depth(coarse, punch.depth_m / body.thickness_m)[0].force * force_unit(law, body)


def _times(punch: Punch, force: float, depth: float = 1.0) -> Punch:
    return replace(punch, force_N=punch.force_N and force * punch.force_N, depth_m=punch.depth_m and (
        depth * punch.depth_m))


def _row(touch: Touch) -> Array:
    """All that is interpolated of a touch."""
    assert touch.section is not None
    volume = touch.section.log_volume
    parts = [*(getattr(touch, name) for name in _FIELDS), *(getattr(touch, name) - 1 for name in _STRETCHES),
             touch.section.displacement_m, np.empty(0) if volume is None else volume]
    return np.concatenate([np.ravel(part) for part in parts]) / touch.depth_m


def _touch(like: Touch, depth_m: float, force_N: float, row: Array, stiffer: float) -> Touch:
    """The touch of a row, on the mesh of another, of moduli so many times as large; errors are the other's."""
    assert like.section is not None
    section, names = like.section, (*_FIELDS, *_STRETCHES)
    sizes = [*(np.size(getattr(like, name)) for name in names), section.displacement_m.size]
    *parts, moved, volume = np.split(depth_m * row, np.cumsum(sizes))
    found = {name: part if part.size > 1 else float(part[0]) for name, part in zip(names, parts, strict=True)}
    found |= {name: found[name] + 1 for name in _STRETCHES} | {name: stiffer * found[name] for name in _STRESSES}
    kept = None if section.log_volume is None else volume.reshape(section.log_volume.shape)
    return replace(like, **found, depth_m=depth_m, force_N=force_N, section=replace(
        section, displacement_m=moved.reshape(-1, 2), log_volume=kept))
