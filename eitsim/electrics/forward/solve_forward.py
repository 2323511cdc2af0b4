"""From touches to readings: what a touch changes in the complete electrode model of the skin."""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from eitsim.electrics.cem import ring_scattering as rings
from eitsim.electrics.cem.assembly import Array, SkinMesh, dissection, impedance, quadrature_points
from eitsim.electrics.cem.coupled_scattering import coupled_scattering
from eitsim.electrics.cem.floating_electrodes import floating
from eitsim.electrics.cem.ring_scattering import Coupling, position
from eitsim.electrics.forward.disc_electrics import DiscSkin
from eitsim.electrics.forward.far_field import born_correction, change_where_they_meet
from eitsim.electrics.forward.outer_correction import outer_correction
from eitsim.electrics.forward.outline_electrics import OutlinedSkin
from eitsim.electrics.forward.skins import skin_of
from eitsim.electrics.forward.untouched import untouched_impedance
from eitsim.electrics.mesh.p2_triangles import HALVINGS, uniform_refinement
from eitsim.scene.channels import Channels, channel_changes
from eitsim.scene.drive import protocol, read_out
from eitsim.scene.electrodes import among_all, contact_impedances, present
from eitsim.scene.results import Readings, Touch
from eitsim.scene.scene import Body, Drive, Electrodes, Punch, Skin
from eitsim.sheet import sheet_conductance as sheet
from matcal.laws.conductivity import Conductivity
from touchcal.jit import cpu_s

Touches = tuple[tuple[Punch, Touch], ...]

METHODS = ("auto", "multipole", "mesh")
# Harmonics about a punch, and the parts that the gaps between the touch's samples are cut into, until it suffices.
ORDERS, PARTS = 16, (1, 2, 4, 8, 16)
# Relative error of dV by "mesh" that halvings do not show, and the power of the number of nodes by which errors fall
# from a rough mesh (quadratic elements whose sizes follow the solution).
UNHALVED, RATE = 1.8e-4, 2
# Where a rough mesh shows the error of an outline's: what it does not show, and what is left over what it does.
UNSEEN, LEFT_ROUGH = 1.3e-4, 0.6
# With edges, what is left over the change by rings cut once more, both extrapolated.
LEFT_RINGS = 1 / 3
# How many times the estimate must stay below the requested error where an edge changes a touch, and of a mesh not to be
# halved again.
MARGIN = 2


@dataclass(frozen=True)
class _Sensor:
    body: Body
    skin: Skin
    # all electrodes, and those of them that have contact
    given: Electrodes
    electrodes: Electrodes
    drive: Drive
    law: Conductivity
    channels: Channels

    @cached_property
    def conductance_S(self) -> float:
        return sheet.untouched_conductance(self.law, self.skin)

    @cached_property
    def solver(self) -> DiscSkin | OutlinedSkin:
        return skin_of(self.body, self.electrodes, self.conductance_S)

    def changes(self, before_Ohm: Array, change_Ohm: Array) -> Array:
        """Changes of readings, V, by one of the impedance matrix of the electrodes that have contact; NaN where another
        is needed."""
        before, change = (among_all(self.given, one) for one in (before_Ohm, change_Ohm))
        return channel_changes(protocol(self.drive, self.given.count), self.channels, before, before + change, change)

    def read_out(self, change_Ohm: Array) -> Array:
        """Changes of readings, V, through channels without error, by which methods are compared."""
        return read_out(self.drive, among_all(self.given, change_Ohm))


@dataclass(frozen=True)
class _Change:
    """Change of the impedance matrix by touches, Ohm, the estimated relative error of its readings, the unknowns."""

    impedance_Ohm: Array
    error: float
    unknowns: int
    method: str


def solve(body: Body, skin: Skin, electrodes: Electrodes, drive: Drive, touches: Touches,
          law: Conductivity, *, channels: Channels | None = None, signal: float = 0.002,
          method: str = "auto") -> Readings:
    """Readings of a touched skin, through channels where they are given; the relative error of dV, 2-norm, is at most
    `signal` where that can be reached.

    The untouched skin is solved once a sensor (`untouched_impedance`). "multipole" adds what the touches,
    stacks of rings about the punches, scatter: together in circles that do not overlap, and each alone out to the
    largest circle about it that fits on the skin, extrapolated from rings half as many. The strain outside counts to
    second order, in the field that the rings leave, near an edge to third, on a mesh (`outer_correction`), and what
    strains make of the conductance where they add up to first order. "mesh" takes dV from two solutions on one mesh
    that follows the touches. "auto" takes the first where it meets `signal`, MARGIN times where an edge changes the
    touch, else the better of both.

    signal_error adds, for "multipole", the change by half as many rings over 15 (fourth order, extrapolated), by three
    quarters of the harmonics, what strain outside the rings makes to second order, half the largest relative change of
    conductance that one touch makes at another's contact, and a quarter of what they make together where they meet
    (measured on pairs with gaps of 2 to 55 mm: a fifth of either, or less), and MISSED; for "mesh" UNHALVED and the
    change by the coarser mesh times LEFT, as halved meshes are nested and cover the same cells, or LEFT_CUT where the
    rim cuts the contact: near the cut no line of the mesh follows its end. A mesh is halved again where MARGIN times
    its estimate exceeds `signal`. With an outline, "multipole" adds as squares MISSED_OUTLINE, LEFT_RINGS of what half
    as many rings change once both are extrapolated, what is left over the changes by coarser meshes of the edges
    (`edge_responses`), what harmonics would add as a geometric series, and the second order outside the rings, or near
    an edge a third of what their fading end changes of it; "mesh", between line electrodes, UNSEEN and, as squares,
    LEFT_ROUGH of what is left over the change from a coarser mesh where errors fall with the square of the number
    of nodes (on an L with a hole, of 32 touches that were not fitted, 31 are covered, 18 of them within a factor of
    3). No estimate holds what interpolation between the touch's own samples costs.

    MISSED, UNHALVED and LEFT are no bounds. UNHALVED and LEFT were fitted to the even ones of 200 random touches: 93 of
    these 100 estimates lie within a factor of 3 of the error and 85 cover it, 90 and 78 of the odd ones; at one touch
    the error is more than three times the estimate (benchmarks/electrics_random.py). The change by halving says little
    of which touch is off more: its rank correlation with the error is 0.28. LEFT_CUT is what two touches among them
    need whose contact the rim cuts; three others lie within 0.0006, estimated 0.0002 to 0.0026. With
    an outline, MISSED_OUTLINE is the largest at which 90 % of the even ones of 100 touches on an L lie within a factor
    of 3, since touches on a rectangle and an ellipse need more than these; other constants were chosen in sight of all:
    94 % of the estimates of 100 touches held back lie within that factor, and a third of the errors exceed them. LEFT
    serves a contact that an edge cuts, too, as the mesh follows its end. Next to a re-entrant corner errors of meshes
    fall more slowly than RATE says: some estimates are a fifth of the error.

    A touch that the rim of a disc, or a neighbour, changes is not axisymmetric and takes the mesh, as patch electrodes
    do, and those on the surface of a skin with an outline; near edges of an outline its circle scatters every harmonic
    into others (`coupled_scattering`). How far the estimates of outlines are off: benchmarks/outline_touches.py.

    ValueError for no touch, contacts that overlap or overhang, an unknown method,
    "multipole" for patches or a touch near the rim, and where the conductivity is not positive.
    """
    start = cpu_s()
    if method not in METHODS:
        raise ValueError(f"method '{method}' is unknown; known: {', '.join(METHODS)}.")
    if not touches:
        raise ValueError("no touch is given; give at least one.")
    sensor = _Sensor(body, skin, electrodes, present(electrodes), drive, law, channels or Channels())
    change = min(_changes(sensor, touches, signal, method), key=lambda c: c.error)
    untouched = untouched_impedance(body, sensor.electrodes, sensor.conductance_S)
    baseline = sensor.changes(np.zeros_like(untouched), untouched)
    dv = sensor.changes(untouched, change.impedance_Ohm)
    extrapolated = sum(sheet.extrapolated_fraction(body, punch, touch, skin, law) for punch, touch in touches)
    return Readings(baseline + dv, baseline, dv, among_all(electrodes, untouched + change.impedance_Ohm), change.error,
                    min(extrapolated, 1.0), change.unknowns, cpu_s() - start, change.method)


def _changes(sensor: _Sensor, touches: Touches, signal: float, method: str) -> Iterator[_Change]:
    """Attempts in the order of their cost; the last one meets the requested error, or none does."""
    lines, changed = sensor.electrodes.along_edge, not all(touch.axisymmetric for _, touch in touches)
    if method == "multipole" and not lines:
        raise ValueError("method 'multipole' is built for line electrodes; with others use 'mesh' or 'auto'.")
    clipped = sensor.solver.needs_mesh(touches)
    if method == "multipole" and clipped:
        raise ValueError("method 'multipole' needs a contact that ends before the edge, no neighbour that changes "
                         "it, and near the rim of a disc an axisymmetric one; use 'mesh' or 'auto'.")
    if method != "mesh" and not clipped and lines:
        change = _by_multipole(sensor, touches, signal)
        yield change
        if method == "multipole" or (MARGIN if changed else 1) * change.error <= signal:
            return
    yield _by_mesh(sensor, touches, signal)


@dataclass(frozen=True, eq=False)
class _Circles:
    """Touches in circles about them, and what couples these."""

    touches: Touches
    reach_m: Sequence[float]
    coupling: Coupling
    varied: Sequence[tuple[Coupling, float]]  # more roughly, and what is left over the change by it
    coupled: Sequence[Array | None]  # what touches scatter that edges change, or layers in their volume; None of others
    sign: float  # 1 where their change counts, -1 where it is taken away


def _by_multipole(sensor: _Sensor, touches: Touches, signal: float) -> _Change:
    """Rings are cut until they no longer matter; then the harmonics, and the meshes of the edges, are varied once."""
    rooms = [rings.admissible_radius(sensor.body, punch) for punch, _ in touches]
    circles = _circles(sensor, touches, rooms)
    rough, own = (_scatterings(sensor, circles, parts) for parts in PARTS[:2])
    coarse, fine, last = _changed(sensor, circles, rough), _changed(sensor, circles, own), PARTS[1]
    for parts in PARTS[2:]:
        if _difference(sensor, fine, coarse) <= 3 * signal / 4:
            break
        own = _scatterings(sensor, circles, parts)
        coarse, fine, last = fine, _changed(sensor, circles, own), parts
    whole, cut = fine + (fine - coarse) / 3, _difference(sensor, fine, coarse) / 15
    if sensor.solver.by_series:
        finest = _changed(sensor, circles, _scatterings(sensor, circles, 2 * last))
        before, whole = whole, finest + (finest - fine) / 3
        cut = LEFT_RINGS * _difference(sensor, whole, before)
    meeting = change_where_they_meet(sensor.body, sensor.electrodes, sensor.conductance_S, touches, sensor.skin,
                                     sensor.law)
    outside, unsure = _outside(sensor, touches, rooms, circles, own, float(np.linalg.norm(fine)))
    strain = _difference(sensor, fine, fine + unsure)
    error = sensor.solver.multipole_error(
        cut, strain, _varied(sensor, circles, own, fine, ORDERS if sensor.solver.by_series else 3 * ORDERS // 4),
        _series_left(sensor, circles, own, fine) if sensor.solver.by_series else 0.0)
    error += _overlap(sensor, touches) / 2 + _difference(sensor, fine, fine + meeting) / 4
    return _Change(whole + outside + meeting, error, 2 * ORDERS * len(touches), "multipole")


def _varied(sensor: _Sensor, circles: Sequence[_Circles], scatterings: Sequence[Array], change: Array,
            orders: int) -> list[float]:
    """What is left of each change by what is known more roughly of the edges or the rim, and by fewer harmonics."""
    found = []
    for k, (_, left) in enumerate(circles[0].varied):
        varied = [replace(one, coupling=one.varied[k][0]) for one in circles]
        found.append(left * _difference(sensor, change, _changed(sensor, varied, scatterings, orders)))
    return found


def _series_left(sensor: _Sensor, circles: Sequence[_Circles], scatterings: Sequence[Array], change: Array) -> float:
    """What harmonics above ORDERS would change, as a geometric series of the changes by the third quarter of them and
    by the last, which leaves no more than the last."""
    half, most = (_changed(sensor, circles, scatterings, orders) for orders in (ORDERS // 2, 3 * ORDERS // 4))
    before, last = _difference(sensor, change, change + most - half), _difference(sensor, change, most)
    ratio = last / before if 2 * last < before else 0.5
    return last * ratio / (1 - ratio)


def _outside(sensor: _Sensor, touches: Touches, rooms: Sequence[float], circles: Sequence[_Circles],
             scatterings: Sequence[Array], change_Ohm: float) -> tuple[Array, Array]:
    """Change by what the rings leave out, where these change so much, and what is unsure of it."""
    changes, unsure = [], []
    for touch, room in zip(touches, rooms, strict=True):
        (one, own, k), *_ = [(one, own, k) for one, own in zip(circles, scatterings, strict=True)
                             for k in range(len(one.touches)) if one.touches[k] is touch and one.reach_m[k] == room]
        found = rings.scattered(one.coupling, sensor.conductance_S, own)
        part = slice(k * ORDERS, (k + 1) * ORDERS)
        field = replace(found, outgoing=found.outgoing[part], returned=found.returned[part])
        by = outer_correction if touch[1].rim is not None else partial(born_correction, change_Ohm=change_Ohm)
        change, left = by(sensor.body, sensor.electrodes, sensor.conductance_S, *touch, sensor.skin, sensor.law, room,
                          field)
        changes.append(change)
        unsure.append(left)
    return np.sum(changes, axis=0), np.sum(unsure, axis=0)


def _circles(sensor: _Sensor, touches: Touches, rooms: Sequence[float]) -> list[_Circles]:
    """All touches in circles that do not overlap, and each alone in the largest circle that has room on the skin, less
    it alone in its own."""
    inner = rings.reaches(sensor.body, touches)
    found = [(touches, inner, 1.0)]
    for touch, own, room in zip(touches, inner, rooms, strict=True):
        if room > own:
            found += [((touch,), [room], 1.0), ((touch,), [own], -1.0)]
    return [_Circles(some, reach, *sensor.solver.couplings(
        [(position(punch), radius) for (punch, _), radius in zip(some, reach, strict=True)], ORDERS), [
        _known(sensor, punch, touch, own) for (punch, touch), own in zip(some, reach, strict=True)], sign)
            for some, reach, sign in found]


def _known(sensor: _Sensor, punch: Punch, touch: Touch, reach_m: float) -> Array | None:
    """What a touch scatters that edges change, or that is solved in a layer's volume; None of others."""
    if touch.scatterer is not None:
        return touch.scatterer.scattering(reach_m, ORDERS)
    return None if touch.rim is None else coupled_scattering(punch, touch, sensor.skin, sensor.law, reach_m, ORDERS)


def _changed(sensor: _Sensor, circles: Sequence[_Circles], scatterings: Sequence[Array],
             orders: int = ORDERS) -> Array:
    """Change by touches in circles, of so many harmonics."""
    changes = []
    for one, whole in zip(circles, scatterings, strict=True):
        kept = np.tile(one.coupling.order <= orders, 2)
        own = whole * np.outer(kept, kept)
        changes.append(one.sign * rings.impedance_change(one.coupling, sensor.conductance_S, own))
    return np.sum(changes, axis=0)


def _scatterings(sensor: _Sensor, circles: Sequence[_Circles], parts: int) -> list[Array]:
    """What the touches in each set of circles scatter together, rings cut in parts where they are axisymmetric."""
    return [rings.together([
        rings.scattering(punch, touch, sensor.skin, sensor.law, reach, ORDERS, parts) if known is None else known
        for (punch, touch), reach, known in zip(one.touches, one.reach_m, one.coupled, strict=True)], ORDERS)
        for one in circles]


def _overlap(sensor: _Sensor, touches: Touches) -> float:
    """Largest relative change of conductance by one touch where the contact of another begins."""
    found = [0.0]
    for (punch, touch), (other, pressed) in itertools.permutations(touches, 2):
        nearest = np.array([abs(position(punch) - position(other)) - pressed.contact_radius_m])
        sheets = sheet.principal_conductances(sensor.law, sensor.skin, *sheet.stretches(touch, nearest))
        found += [float(np.abs(along / sensor.conductance_S - 1)[0]) for along in sheets]
    return max(found)


def _by_mesh(sensor: _Sensor, touches: Touches, signal: float) -> _Change:
    """The mesh is halved until the coarser one agrees; all halvings cover the same curved cells. A rough mesh, where
    there is one, may show that no halving is needed."""
    cut = sensor.solver.on_patches(touches) or any(
        rings.admissible_radius(sensor.body, punch) < touch.contact_radius_m for punch, touch in touches)
    mesh, rough = sensor.solver.touch_mesh(touches), sensor.solver.rough_mesh(touches, cut)
    change = _on_mesh(sensor, touches, mesh)
    share = 1.0 if rough is None else (len(rough.nodes_m) / len(mesh.nodes_m)) ** RATE
    if rough is not None and share < 1:
        error = math.hypot(UNSEEN, LEFT_ROUGH * share / (1 - share)
                           * _difference(sensor, change, _on_mesh(sensor, touches, rough)))
        if MARGIN * error <= signal:
            return _Change(change, error, _unknowns(mesh), "mesh")
    return _halved(sensor, touches, mesh, change, signal, sensor.solver.left(cut))


def _halved(sensor: _Sensor, touches: Touches, mesh: SkinMesh, change: Array, signal: float,
            left: float) -> _Change:
    """The change on a mesh that is halved until MARGIN times the estimate meets the requested error, or no more; left:
    what is left, over the change by the last halving."""
    error = math.inf
    for _ in range(HALVINGS):
        coarse, mesh = change, uniform_refinement(mesh)
        change = _on_mesh(sensor, touches, mesh)
        error = UNHALVED + left * _difference(sensor, change, coarse)
        if MARGIN * error <= signal:
            break
    return _Change(change, error, _unknowns(mesh), "mesh")


def _unknowns(mesh: SkinMesh) -> int:
    return len(mesh.nodes_m) + mesh.count - 1


def _on_mesh(sensor: _Sensor, touches: Touches, mesh: SkinMesh) -> Array:
    z, order, conductors = contact_impedances(sensor.electrodes), dissection(mesh), floating(mesh, touches)
    touched = sheet.touched_conductance(quadrature_points(mesh), touches, sensor.skin, sensor.law)
    untouched = np.full(len(mesh.cells), sensor.conductance_S)
    shunted = order if conductors is None else dissection(mesh, conductors)
    return (impedance(mesh, touched, z, order=shunted, floating=conductors)
            - impedance(mesh, untouched, z, order=order))


def _difference(sensor: _Sensor, change: Array, other: Array) -> float:
    """Relative difference of the readings of two changes, 2-norm; 0 where neither changes anything."""
    signal, gap = (np.linalg.norm(np.nan_to_num(sensor.read_out(z))) for z in (change, other - change))
    return float(gap / signal) if gap > 0 else 0.0
