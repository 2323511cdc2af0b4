"""Load paths: equilibria of one punch and law at chosen depths, without units, and what is kept of each.

Lengths are over the thickness H, stresses over mu_0, forces over mu_0 H^2. The depth is the coordinate: force and
surface are smooth in it where the foam softens and a small force moves the punch far.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from eitsim.mechanics.axisymmetric import surface
from eitsim.mechanics.axisymmetric.indentation import Equilibrium, IndentationProblem
from eitsim.mechanics.axisymmetric.solve_axisymmetric import mesh_hierarchy, touch_of, under_force
from eitsim.scene.results import of_strain
from eitsim.scene.scene import STRAINS, Body, Punch
from eitsim.sheet.sheet_conductance import dipole, driving_strains
from matcal.laws.law import Law
from touchcal.arrays import Array
from touchcal.errors import NotConverged

# What a node keeps: fields of the surface, and numbers. Area and wall are over those of the punch, its face's and its
# shank's one thickness high; the contact's end counts from the punch's edge; the force is the mean pressure on the
# face.
FIELDS = ("u_r", "u_z", "stretch_meridian", "stretch_hoop", "stretch_normal", "pressure")
NUMBERS = ("mean_pressure", "corrected_share", "contact_end", "contact_area", "wall_contact", "sigma_max")
# What the solution reports of itself; errors as logarithms.
ERRORS = ("log_depth_error", "log_sigma_max_error", "log_contact_area_error", "fraction_non_elliptic",
          *(f"log_signal_error_{name}" for name in STRAINS), *(f"log_strain_error_{name}" for name in STRAINS),
          "log_contact_end_error")
# Feature lengths outside the punch's edge over which elements keep their size: shallow contacts end there, once the
# foam has climbed the fillet. Where elements widen from the edge on, two meshes differ by up to 2.4 % in a dipole
# response, here by 1 %, for one seventh more unknowns.
_EVEN = 1.0
# Step, over the depth, of the central differences by depth.
_DIFFERENCE = 1e-4
# How near the predicted force must bring the depth to its target, in parts of the step, and the attempts at it.
_NEAR, _ATTEMPTS = 0.2, 4
# Largest deviations in the middle of an interval that is not halved, and the least interval over its depth.
_DEPTH, _SIGNAL, _STRAIN, _LEAST_INTERVAL = 3e-4, 2e-3, 0.05, 0.02
# Conductivity of the nominal skin by which signals are compared: exp(_SENSITIVITY strain).
_SENSITIVITY = -2.0
# Where the parts of a dipole response cancel, differences are relative to this share of what they add up to.
_CANCELLING = 0.1


@dataclass(frozen=True, eq=False)
class LoadPath:
    """One punch, discretised, and the radii at which its surface is kept."""

    law: Law
    body: Body
    levels: tuple[IndentationProblem, ...]
    radius: Array  # (r,) reference radii

    @property
    def face(self) -> float:
        """Area of the punch's face, fillet included."""
        return float(np.pi * self.levels[0].punch.profile.radius**2)


@dataclass(frozen=True, eq=False)
class Node:
    """One equilibrium of a path."""

    depth: float  # depth of the punch as solved, before the correction for penetration
    # (6, r) FIELDS at the path's radii, and their derivatives by the depth
    fields: Array
    slopes: Array
    numbers: Array  # (6,) NUMBERS; the corrected depth is corrected_share times the depth before
    error_estimate: Array  # (11,) ERRORS
    stiffness: float  # derivative of the mean pressure by the depth
    states: tuple[Equilibrium, ...]  # equilibria on all levels; empty where they are no longer needed

    @property
    def mean_pressure(self) -> float:
        return float(self.numbers[0])

    @property
    def corrected_depth(self) -> float:
        return self.depth * float(self.numbers[1])


@dataclass(frozen=True, eq=False)
class Deviation:
    """How far an interpolated touch is from one solved anew at the same force, relative."""

    depth: float
    # (3,) dipole response of a nominal skin by scene.STRAINS; at least a tenth of what its parts add up to is the scale
    signals: Array
    strain: float  # all three stretches of the surface, L2 over the reference area

    def signal(self, strain: str) -> float:
        """That of the signal of a skin driven by this strain."""
        return of_strain(self.signals, strain)

    def at_least(self, other: Deviation) -> Deviation:
        """The larger of both, each by itself."""
        return Deviation(max(self.depth, other.depth), np.maximum(self.signals, other.signals),
                         max(self.strain, other.strain))


def course_of(law: Law, body: Body, punch: Punch, radius: Array | None = None) -> LoadPath:
    """A punch and a law without units, kept at these reference radii, by default at those of the surface's samples."""
    levels = tuple(mesh_hierarchy(law, body, punch, None, None, even=_EVEN))
    if radius is None:
        radius = surface.samples(levels[-1], np.zeros(levels[-1].grid.unknowns + 1))[0]
    return LoadPath(law, body, levels, radius)


def refined(course: LoadPath, depths: Sequence[float]) -> list[Node]:
    """A path near these increasing depths and, where cubics between them deviate too much, between. It ends before the
    first interval that stays too coarse, or where no equilibrium is found."""
    nodes = list(traced(course, depths))
    done, ahead = nodes[:1], nodes[:0:-1]
    while ahead:
        left, right = done[-1], ahead[-1]
        middle = _between(course, left, right)
        if middle is None:
            break
        depth, fields = interpolated(left, right, middle.mean_pressure)
        found = deviation(course, depth / middle.depth, fields, middle.fields)
        if found.depth <= _DEPTH and found.signals.max() <= _SIGNAL and found.strain <= _STRAIN:
            done += [middle, ahead.pop()]
        elif right.depth - left.depth > _LEAST_INTERVAL * right.depth:
            ahead.append(middle)
        else:
            break
    return done


def traced(course: LoadPath, depths: Sequence[float]) -> Iterator[Node]:
    """Nodes near the given depths, which increase, each started from those before it. It ends where no equilibrium is
    found, or none near a depth, as where the punch falls through."""
    nodes: list[Node] = []
    for depth in depths:
        try:
            node = _towards(course, depth, nodes[-2:])
        except NotConverged:
            return
        if node is None:
            return
        nodes.append(node)
        yield node


def interpolated(left: Node, right: Node, mean_pressure: float) -> tuple[float, Array]:
    """Depth and FIELDS (6, r) at a mean pressure between those of two nodes."""
    ends = np.array([left.depth, right.depth])
    depth = depth_at(ends, np.array([left.mean_pressure, right.mean_pressure]),
                     np.array([left.stiffness, right.stiffness]), mean_pressure)
    return depth, hermite(ends, np.stack([left.fields, right.fields]), np.stack([left.slopes, right.slopes]), depth)


def hermite(ends: Array, values: Array, slopes: Array, at: float) -> Array:
    """Cubic with these values (2, ...) and slopes (2, ...) at both ends (2,), at one place."""
    h = ends[1] - ends[0]
    t = (at - ends[0]) / h
    a, b = (1 + 2 * t) * (1 - t)**2, t * (1 - t)**2 * h
    c, d = t**2 * (3 - 2 * t), t**2 * (t - 1) * h
    return a * values[0] + b * slopes[0] + c * values[1] + d * slopes[1]


def depth_at(ends: Array, values: Array, slopes: Array, target: float) -> float:
    """Where the cubic between two ends (2,) takes a value between theirs; by bisection, to rounding."""
    low, high = ends
    while high - low > 4e-16 * high:
        middle = (low + high) / 2
        if middle in (low, high):
            break
        low, high = (middle, high) if hermite(ends, values, slopes, middle) < target else (low, middle)
    return float((low + high) / 2)


def deviation(course: LoadPath, depth_ratio: float, fields: Array, fresh: Array) -> Deviation:
    """Deviation of FIELDS (6, r) from those solved anew under the same force, and of a depth from its ratio to
    theirs."""
    r = course.radius
    weight = np.gradient(r) * r
    separation, strain = fields[2:5] - fresh[2:5], fresh[2:5] - 1
    response, parts = _responses(course, fresh)
    return Deviation(abs(depth_ratio - 1), np.abs(_responses(course, fields)[0] - response)
                     / np.maximum(np.abs(response), _CANCELLING * parts),
                     float(np.sqrt((separation**2 @ weight).sum() / (strain**2 @ weight).sum())))


def _responses(course: LoadPath, fields: Array) -> tuple[Array, Array]:
    """(3,) dipole responses of nominal skins with FIELDS (6, r), and what their parts add up to without their signs."""
    (meridian, hoop, normal), radius = fields[2:5, 1:], course.radius[1:]
    sheet = np.exp(_SENSITIVITY * driving_strains(meridian, hoop, normal))
    radial, around = sheet * hoop / meridian, sheet * meridian / hoop
    parts = (np.abs(np.log(radial)) + np.abs(np.log(around))) @ (np.gradient(radius) * radius)
    return np.array([dipole(radius, *pair) for pair in zip(radial, around, strict=True)]), parts


def _towards(course: LoadPath, depth: float, before: list[Node]) -> Node | None:
    """The node near a depth, from up to two before it; None where several attempts miss it."""
    tries = list(before)
    step = depth - (tries[-1].depth if tries else 0.0)
    for _ in range(_ATTEMPTS):
        node = _node(course, _pressure_at(depth, tries), tries[-1] if tries else None)
        if abs(node.depth - depth) <= _NEAR * step:
            return node
        tries = sorted([*tries, node], key=lambda n: -abs(n.depth - depth))[-2:]
    return None


def _between(course: LoadPath, left: Node, right: Node) -> Node | None:
    depth = (left.depth + right.depth) / 2
    try:
        node = _node(course, _pressure_at(depth, [left, right]), left)
    except NotConverged:
        return None
    return node if left.depth < node.depth < right.depth else None


def _pressure_at(depth: float, nodes: list[Node]) -> float:
    """Cubic through two nodes, at most e-fold past the last; linear from one; a guess from none."""
    if not nodes:
        return depth
    last = nodes[-1]
    if len(nodes) == 1:
        value = last.mean_pressure + last.stiffness * (depth - last.depth)
    else:
        ends, values, slopes = (np.array([getattr(n, name) for n in nodes])
                                for name in ("depth", "mean_pressure", "stiffness"))
        value = float(hermite(ends, values, slopes, depth))
    return float(np.clip(value, last.mean_pressure / np.e, last.mean_pressure * np.e))


def _node(course: LoadPath, mean_pressure: float, before: Node | None) -> Node:
    """The equilibrium under a mean pressure, from a node before it, first along its tangent, or from rest."""
    force, levels = mean_pressure * course.face, list(course.levels)
    if before is None:
        return _kept(course, under_force(levels, force, None))
    coarse = before.states[0]
    ahead = replace(coarse, x=coarse.x + coarse.by_force * (force - coarse.force), force=force)
    try:
        return _kept(course, under_force(levels, force, ahead))
    except NotConverged:
        return _kept(course, under_force(levels, force, coarse))


def _kept(course: LoadPath, states: list[Equilibrium]) -> Node:
    model, state = course.levels[-1], states[-1]
    touch = touch_of(course.law, course.body, list(course.levels), states, 0.0)
    depth, by_depth = float(state.x[-1]), state.by_force / state.by_force[-1]
    step = _DIFFERENCE * depth
    fields, ahead, behind = (_sampled(course, model, state.x + s * step * by_depth) for s in (0, 1, -1))
    radius = model.punch.profile.radius
    numbers = np.array([state.force / course.face, state.depth / depth, touch.contact_radius_m - radius,
                        touch.contact_area_m2 / course.face, touch.wall_contact_m2 / (2 * np.pi * radius),
                        touch.sigma_max_Pa])
    errors: list[Any] = [touch.depth_error, touch.sigma_max_error, touch.contact_area_error]
    assert touch.strain_errors is not None
    assert touch.contact_end_error is not None
    error_estimate = np.array([*np.log(errors), touch.fraction_non_elliptic, *np.log(touch.signal_errors),
                               *np.log(touch.strain_errors), np.log(touch.contact_end_error)])
    stiffness = 1 / float(state.by_force[-1]) / course.face
    return Node(depth, fields, (ahead - behind) / (2 * step), numbers, error_estimate, stiffness, tuple(states))


def _sampled(course: LoadPath, model: IndentationProblem, x: Array) -> Array:
    """FIELDS (6, r) at the course's radii: monotone cubics between the samples of the surface."""
    radius, field = surface.samples(model, x)
    contact = surface.contact_of(model, x)
    pressure = np.interp(radius, contact.middle, contact.pressure, right=0.0)
    values = np.stack([field.position[:, 0] - radius, field.position[:, 1], field.meridian, field.hoop, field.normal,
                       pressure])
    if np.array_equal(radius, course.radius):
        return values
    return PchipInterpolator(radius, values, axis=1)(np.minimum(course.radius, radius[-1]))
