"""What it costs to solve each of several touches as if it were alone."""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch
from eitsim.sheet.sheet_conductance import surface_metric

# numbers of touches that are solved together
Groups = Sequence[Sequence[int]]

# Gap between the edges of two punches over the foam's thickness against the largest relative change of dV by solving
# them together. Measured on pairs of equal flat punches (10 mm 2 N, 14 mm 0.1, 1 and 3 N, 18 mm 0.5 N; Table 1, skins
# driven by normal and principal strain), whose middle is a plane of symmetry of a three-dimensional patch. After the
# last point it decays as the surface strain does, over _DECAY thicknesses.
_GAP = np.array([0.6, 1.0, 1.5, 2.0, 2.5, 3.0])
_EFFECT = np.array([0.19, 0.15, 0.052, 0.0068, 0.0048, 0.0037])
_DECAY = 0.7
# Bounds of what changes, over the strain and uplift by the neighbour. Of dV it was 1.2 at most and 0.2 in the middle of
# 52 of those pairs; once, on a larger patch with a deep punch, whose strains are noisy under it, 2.3. Of the depth it
# was 0.5, of the normal strain (L2) 2.2 at most in random pairs (benchmarks/omissions.py).
_PER_STRAIN = {"signal": 1.5, "depth": 1.0, "strain": 3.0}
# Radii and angles under a punch at which its neighbour's field is looked at.
_RADII, _ANGLES = 6, 48


def edge_gap_m(one: Punch, other: Punch) -> float:
    """Distance between the edges of two punches, m; negative where they overlap."""
    return math.hypot(one.x_m - other.x_m, one.y_m - other.y_m) - (one.diameter_m + other.diameter_m) / 2


def gap_effect(gap_m: float, thickness_m: float) -> float:
    """Relative change of dV by solving two touches together at a distance gap_m of their edges; a table, see above."""
    gap = gap_m / thickness_m
    return float(np.interp(gap, _GAP, _EFFECT)) * math.exp(-max(gap - _GAP[-1], 0) / _DECAY)


def clusters(body: Body, punches: Sequence[Punch], allowed: float) -> tuple[tuple[int, ...], ...]:
    """Numbers of the touches that must be solved together, so that the neighbours left out cost each touch at most
    `allowed`; none where they cost less anyway."""
    if len(punches) < 2 or expected(body, punches) <= allowed:
        return ()
    groups = [{i} for i in range(len(punches))]
    for i, j in itertools.combinations(range(len(punches)), 2):
        gap = edge_gap_m(punches[i], punches[j])
        if gap_effect(gap, body.thickness_m) > allowed / (len(punches) - 1):
            met = [group for group in groups if i in group or j in group]
            groups = [group for group in groups if group not in met] + [set().union(*met)]
    return tuple(tuple(sorted(group)) for group in groups if len(group) > 1)


def expected(body: Body, punches: Sequence[Punch], together: Groups = ()) -> float:
    """Relative change of dV by neighbours before anything is solved: the largest sum over the neighbours that a punch
    is not solved together with."""
    return max(sum(gap_effect(edge_gap_m(punch, other), body.thickness_m) for j, other in enumerate(punches)
                   if _separate(i, j, together)) for i, punch in enumerate(punches))


def _separate(i: int, j: int, together: Groups) -> bool:
    return i != j and not any(i in group and j in group for group in together)


def gap_for(effect: float, thickness_m: float) -> float:
    """Least gap, m, from which the change is at most `effect` > 0."""
    if effect <= _EFFECT[-1]:
        return float(_GAP[-1] + _DECAY * math.log(_EFFECT[-1] / effect)) * thickness_m
    return float(np.interp(-effect, -_EFFECT, _GAP)) * thickness_m


def interaction(touches: Sequence[tuple[Punch, Touch]], together: Groups = ()) -> dict[str, float]:
    """Bounds of the relative changes "signal", "depth" and "strain" (L2) of solved touches by neighbours that they are
    not solved together with. A neighbour lifts the foam under a punch and strains its surface; both are taken as if the
    punch were not there. The strain and the uplift over the depth, times _PER_STRAIN, bound what changes."""
    largest = 0.0
    for i, (punch, touch) in enumerate(touches):
        sums = 0.0
        for j, (other, pressed) in enumerate(touches):
            if _separate(i, j, together):
                strain, uplift = _under(punch, other, pressed)
                sums += strain + uplift / touch.depth_m
        largest = max(largest, sums)
    return {key: factor * largest for key, factor in _PER_STRAIN.items()}


def _under(punch: Punch, other: Punch, touch: Touch) -> tuple[float, float]:
    """Largest strain and vertical displacement, m, of another's touch under a punch."""
    radius, angle = np.meshgrid(np.linspace(0, punch.diameter_m / 2, _RADII), np.linspace(0, 2 * np.pi, _ANGLES))
    points = np.stack([punch.x_m + radius * np.cos(angle), punch.y_m + radius * np.sin(angle)], axis=-1)
    metric, normal = surface_metric(points, other, touch)
    stretch = np.sqrt(np.linalg.eigvalsh(metric))
    strain = max(float(np.abs(stretch - 1).max()), float(np.abs(normal - 1).max()))
    away = np.hypot(points[..., 0] - other.x_m, points[..., 1] - other.y_m)
    uplift = float(np.abs(np.interp(away, touch.radius_m, touch.u_z_m, right=0.0)).max())
    return strain, uplift
