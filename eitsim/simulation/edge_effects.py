"""How much the rim of a disc, or the edges of an outline, change a touch."""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from eitsim.scene.edges.electrode_outlines import outlines_m
from eitsim.scene.polygons import distance_to
from eitsim.scene.scene import Punch, Scene, rim_gap_m

# Effect of the rim: gap from the punch's edge to the rim over the foam's thickness against the largest relative change
# by the rim of depth, of the strain that drives the skin (2-norm) and of dV (2-norm), for 8 mm and 0.3 N, 14 mm and 1
# and 3 N, 20 mm and 2 N on a disc of 10 x 100 mm (benchmarks/rim.py). In-plane strains change more than the normal one.
# Beyond the last point it decays with the last two points' rate.
_GAP = np.array([0.05, 0.5, 1.0, 2.0, 3.0, 4.0])
_RIM_EFFECT = {"normal": np.array([0.18, 0.18, 0.14, 0.057, 0.031, 0.008]),
               "principal": np.array([0.27, 0.26, 0.13, 0.034, 0.0095, 0.0026]),
               "areal": np.array([0.49, 0.36, 0.215, 0.05, 0.017, 0.0045])}
# How much further edges change a layer on a soft base, by the power of mu_0 of the layer over that of the base: as that
# of the length over which a plate bends on what it lies on (benchmarks/soft_base.py).
_SPREAD = 1 / 4
# Part of the requested signal error that neglecting edges may use up.
EDGE_SHARE = 0.5
# What one edge changes of another's change, over the product of both as tabulated (benchmarks/several_edges.py): above
# all that was measured by the normal and by the largest strain in plane.
_INTERPLAY = 6.0
# Effect of stiff electrodes on dV by the strain that drives the skin: size, and rates of its decay with the gaps from
# the punch's edge to the nearest and to the edge of the skin, and with the punch's diameter, over the foam's thickness.
# Fitted to the logarithms of 34 random touches, the size above 95 % of them; sizes and rates of the even ones hold 93
# to 100 % of the odd ones, 2.3 to 3.7 times as wide in the median (benchmarks/stiff_electrodes.py).
_ELECTRODE_EFFECT = {"normal": (1.35, 0.8, 0.8, 0.7), "principal": (1.5, 1.33, 0.62, 0.0),
                     "areal": (5.1, 1.8, 0.36, 0.0)}


def rim_effect(gap_m: float, thickness_m: float, strain: str) -> float:
    """Largest relative change by the rim, gap_m from the punch's edge, from _RIM_EFFECT.

    strain: what drives the skin, one of scene.STRAINS.
    """
    gap, effect = gap_m / thickness_m, _RIM_EFFECT[strain]
    if gap <= _GAP[-1]:
        return float(np.interp(gap, _GAP, effect))
    rate = math.log(effect[-2] / effect[-1]) / (_GAP[-1] - _GAP[-2])
    return float(effect[-1] * math.exp(-rate * (gap - _GAP[-1])))


def effect_of_edges(scene: Scene, punch: Punch, stiffer: float = 1.0) -> float:
    """What neglecting the rim, or all edges and holes of an outline, may cost: the sum of what the rim of a disc would,
    as near as the nearest part of them in each quarter about the punch; of a layer so many times as stiff as its base.
    """
    gaps = scene.body.edge.quarters_m((punch.x_m, punch.y_m)) - punch.diameter_m / 2
    unit_m = scene.body.thickness_m * max(stiffer, 1.0) ** _SPREAD
    return sum(rim_effect(gap, unit_m, scene.skin.surface_strain) for gap in gaps.tolist())


def far_edges_effect(scene: Scene, punch: Punch, outside: float) -> float:
    """What the edges further from its edge than so many thicknesses may cost, as `effect_of_edges`."""
    gaps = scene.body.edge.quarters_m((punch.x_m, punch.y_m)) - punch.diameter_m / 2
    return sum(rim_effect(gap, scene.body.thickness_m, scene.skin.surface_strain) for gap in gaps.tolist()
               if math.isfinite(gap) and gap > outside * scene.body.thickness_m)


def other_edges_effect(scene: Scene, punch: Punch, outside: float = -math.inf) -> float:
    """What the edges but the nearest may cost: the sum of what the rim of a disc would, as near as the nearest of them
    in each quarter about the punch; outside: of those further from its edge than so many thicknesses."""
    others = scene.body.edge.nearest((punch.x_m, punch.y_m)).others_m - punch.diameter_m / 2
    return sum(rim_effect(gap, scene.body.thickness_m, scene.skin.surface_strain) for gap in others.tolist()
               if math.isfinite(gap) and gap > outside * scene.body.thickness_m)


def added_edges_cost(scene: Scene, punch: Punch, reach: float) -> float:
    """What adding up the changes by several edges, each found by itself, may cost of the signal: products of two of
    them, and those of edges further from the punch's edge than a reach, thicknesses."""
    effects = [rim_effect(gap, scene.body.thickness_m, scene.skin.surface_strain) for gap in (
        scene.body.edge.quarters_m((punch.x_m, punch.y_m)) - punch.diameter_m / 2).tolist()]
    products = sum(one * other for one, other in itertools.combinations(effects, 2))
    return _INTERPLAY * products + other_edges_effect(scene, punch, reach)


def effect_of_electrodes(scene: Scene, punch: Punch) -> float:
    """What stiff electrodes may change of the signal of a touch, at most; none where they are soft. Patches, which are
    smaller and give way more, count as plates at their place do."""
    if scene.electrodes.soft:
        return 0.0
    unit, (size, *rates) = scene.body.thickness_m, _ELECTRODE_EFFECT[scene.skin.surface_strain]
    gap = max(electrode_gap_m(scene, punch), 0.0) / unit
    edge = rim_gap_m(scene.body, punch) / unit if scene.electrodes.along_edge else gap
    return size * math.exp(-float(np.dot(rates, [gap, edge, punch.diameter_m / unit])))


def electrode_gap_m(scene: Scene, punch: Punch) -> float:
    """Distance, m, of a punch's edge to the nearest electrode; negative where it overlaps one."""
    at = np.array([punch.x_m, punch.y_m])
    return min(distance_to(path, at) for path in outlines_m(scene.body.edge, scene.electrodes)) - punch.diameter_m / 2


def least_gap_m(scene: Scene) -> float:
    """Least distance, m, of a punch's edge to the rim, or to both edges of a right-angled corner, at which neglecting
    them costs no more than its share of the requested error; infinite beyond ten thicknesses."""
    return clear_gap_m(scene.body.thickness_m, scene.skin.surface_strain, scene.accuracy.signal, scene.body.edge.corner)


def clear_gap_m(thickness_m: float, strain: str, signal: float, ways: Sequence[float] = (1.0,)) -> float:
    """As `least_gap_m`, of edges that lie so many times further than the nearest."""
    gaps = np.arange(0.0, 10.0, 0.01)
    near = np.array([sum(rim_effect(way * gap * thickness_m, thickness_m, strain) for way in ways)
                     for gap in gaps]) > EDGE_SHARE * signal
    return math.inf if near[-1] else float(gaps[np.argmin(near)] * thickness_m)
