"""What the simulation returns: the touch (mechanics), the readings (electrics), the plan, and all of them together."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from eitsim.scene.scene import STRAINS
from matcal.laws.law import Law
from touchcal.arrays import Array


@dataclass(frozen=True)
class Decision:
    """One choice of the plan."""

    kind: str  # what was decided, by which code compares: a Kind, or that of a route
    decision: str  # the same in words, for instance "axisymmetric about the punch"
    reason: str  # why
    error_bound: float  # relative error of the touch signal dV that it may cost, at most; 0 where it costs none
    unbounded: bool = False  # whether it leaves something out whose cost is unknown
    # relative error of the strain that drives the skin, L2 over the surface, that it may cost; None: as error_bound
    strain_bound: float | None = None
    remedy: str = ""  # what to write in a scene where it costs nothing, a sentence; empty where nothing says so
    touch: int | None = None  # number of the touch that it is of, from 1; None: of all, or of the only one


@dataclass(frozen=True)
class Plan:
    """What a scene needs, decided before anything is solved."""

    decisions: tuple[Decision, ...]
    refusal: str = ""  # why the scene cannot be solved; empty where it can

    @property
    def error_bound(self) -> float:
        """Sum of the bounds of the decisions."""
        return sum(d.error_bound for d in self.decisions)

    @property
    def strain_bound(self) -> float:
        """Sum of the bounds of the decisions on the strain that drives the skin."""
        return sum(d.error_bound if d.strain_bound is None else d.strain_bound for d in self.decisions)


@dataclass(frozen=True, eq=False)
class RimField:
    """What the rim changes at the surface about a punch; symmetric about the line to the nearest point of the rim.
    Samples lie on circles about the punch's axis, as far as these lie inside the disc. Axes: towards the nearest point
    of the rim, across, and upwards. Nothing is changed outside the last circle. Or what a neighbour changes but for its
    own touch, in this punch's half: the plane between both stands for the rim."""

    radius_m: Array  # (n,) reference radii of the circles, m, increasing
    # (k,) places on a circle: 0 on the line to the nearest point of the rim, or on the rim where it cuts the circle, 1
    # half a turn from that line, in proportion to the angle
    share: Array
    displacement_m: Array  # (n, k, 3) displacement added to the axisymmetric one, m
    # (n, k, 3) in-plane metric seen from the axisymmetric stretches U: xx, xy, yy of U^-1 C U^-1; 1, 0, 1 is no change
    metric: Array
    normal: Array  # (n, k) factor of the stretch normal to the surface
    # radius of the disc, and distance of the punch's axis from its centre, m; infinite and 0 on a whole turn
    disc_m: float
    offset_m: float
    # (2,) direction to the neighbour, on whose side of the plane nothing is changed, or to the edge of an outline; None
    # for the rim of a disc, outwards from its centre
    towards: Array | None = None
    neighbour: bool = False  # whether it is a neighbour's
    # whether nothing is symmetric: places are shares of a whole turn, counter-clockwise from `towards`, the last one
    # being the first again; samples off the skin are those of the nearest place next to it
    whole_turn: bool = False
    # (4,) how far the depth, and the signals by scene.STRAINS, may be off those solved anew, relative; None where they
    # are
    error_estimate: Array | None = None


class SurfaceField(Protocol):
    """What touches that are solved together in three dimensions make of the whole skin; they share one."""

    def metric(self, points_m: Array) -> tuple[Array, Array]:
        """In-plane metric C_s (..., 2, 2) and stretch normal to the surface (...) at points (..., 2) of the untouched
        skin, m; 1 where nothing is solved."""
        ...

    def displacement(self, points_m: Array) -> Array:
        """Displacement (..., 3), m, along x, y and upwards, at points (..., 2), m."""
        ...


class Scatterer(Protocol):
    """What a touch of a layer scatters, solved in its volume."""

    def scattering(self, reach_m: float, orders: int) -> Array:
        """(orders,) as of `electrics.cem.ring_scattering.scattering`."""
        ...


class SpaceField(Protocol):
    """What touches make of a curved body, at places of its untouched outer surface."""

    def near(self, points_m: Array) -> NDArray[np.bool_]:
        """(n,) whether points (n, 3), m, lie where something may move."""
        ...

    def deformation_gradient(self, points_m: Array) -> Array:
        """F (n, 3, 3) at points (n, 3), m; the identity where nothing moves."""
        ...

    def displacement(self, points_m: Array) -> Array:
        """Displacement (n, 3), m, of points (n, 3), m."""
        ...


@dataclass(frozen=True)
class Section:
    """The foam's displacement on the half-plane through the punch's axis, on its elements; the layer's alone where it
    lies on a soft base."""

    nodes_m: Array  # (nodes, 2) reference position (r, z), m, z = 0 at the top
    # (elements, 4 or 9) nodes: corners counter-clockwise; of order 2 middles of edges, centre
    elements: NDArray[np.int64]
    # (nodes, 2) displacement (u_r, u_z), m
    displacement_m: Array
    law: Law
    # (elements, 1 or 3) logarithm of the change of volume that a nearly incompressible law resists, along
    # `mechanics.solid.grid.modes`; None: the displacements' own
    log_volume: Array | None = None


@dataclass(frozen=True, eq=False)
class Volume:
    """The foam's displacement about a punch near an edge, by harmonics of the angle on the mesh of a meridian. Angles
    count from the direction to the nearest point of the rim, or of the edge; harmonics are those of
    `eitsim.mechanics.harmonics.arcs`. It is the solution on the mesh by which the rim's change was found, coarser than
    the axisymmetric section's."""

    # (columns,) and (rows,) reference radii and heights of the nodes, m, increasing; 0 at the axis and at the top
    radius_m: Array
    height_m: Array
    order: int  # order of the elements
    amplitude_m: Array  # (columns, rows, 3, harmonics) amplitudes of u_r, u_theta and u_z, m
    facet_m: Array  # (facets,) reference radii of the middles of the facets where the punch may touch, m
    share: Array  # (k,) places on a circle, as in RimField
    pressure_Pa: Array  # (facets, k) contact pressure on the deformed surface, Pa, averages along the facets
    # radius of the disc, distance of the punch's axis from its centre, m, as in RimField; and radius of the punch, m
    disc_m: float
    offset_m: float
    punch_m: float
    # angle of the direction that angles count from, from the x axis, rad
    bearing_rad: float
    law: Law
    axis_m: Array  # (2,) x and y of the punch's axis, m
    # (edges, 2, 2) starts and ends of the edges of an outline, from the punch's axis, m; None on a disc
    edges_m: Array | None = None
    whole_turn: bool = False  # whether nothing is symmetric: harmonics and places are those of a whole turn


@dataclass(frozen=True, eq=False)
class Touch:
    """One solved touch, axisymmetric about its punch but for `rim` ("Solution" of the mechanics)."""

    radius_m: Array  # (n,) reference radii of surface samples from the punch axis, m, increasing from 0
    u_r_m: Array  # (n,) radial displacement of the surface, m
    u_z_m: Array  # (n,) vertical displacement of the surface, m, down negative
    stretch_meridian: Array  # (n,) stretch of the surface along the meridian
    stretch_hoop: Array  # (n,) stretch of the surface around the axis
    stretch_normal: Array  # (n,) stretch through the thickness, normal to the deformed surface: J over the areal one
    pressure_Pa: Array  # (n,) contact pressure on the deformed surface, Pa
    contact_radius_m: float  # reference radius outside which no surface sample touches the punch (wall included), m
    force_N: float  # reaction on the punch, N
    depth_m: float  # depth of the punch face below the undeformed surface, penalty effect corrected, m
    sigma_max_Pa: float  # largest contact pressure, force over current area, average over a facet of the mesh, Pa
    sigma_ave_Pa: float  # force over contact area, Pa
    contact_area_m2: float  # current area projected on the punch face where pressure > 0, m^2
    wall_contact_m2: float  # current area of the foam that touches the side of the punch, m^2
    depth_error: float  # estimated relative error of depth_m
    # (3,) estimated relative error of dV that the mechanical discretisation causes, by scene.STRAINS
    signal_errors: Array
    fraction_non_elliptic: float  # fraction of quadrature points where strong ellipticity is lost
    iterations: int  # Newton iterations spent
    residuals: tuple[float, ...]  # relative residual after each iteration
    cpu_s: float  # CPU time spent, s
    sigma_max_error: float | None = None  # estimated relative error of sigma_max_Pa; None where it is not estimated
    contact_area_error: float | None = None  # estimated relative error of contact_area_m2; None where not estimated
    contact_end_error: float | None = None  # estimated relative error of contact_radius_m; None where not estimated
    # (3,) estimated relative errors of the strains that may drive the skin, L2 over the surface, by scene.STRAINS; None
    # where they are not estimated
    strain_errors: Array | None = None
    # (2, 2) least and largest reference radius, and depth below the untouched surface, m, where strong ellipticity is
    # lost; None where it is kept
    non_elliptic_m: Array | None = None
    section: Section | None = None  # displacement inside the foam; None where it is not kept
    slip_fraction: float | None = None  # part of the reference area in contact that slips; None without friction
    # what the rim or a neighbour changes at the surface; None where they are far. Depth and contact hold it, the arrays
    # above do not
    rim: RimField | None = None
    volume: Volume | None = None  # displacement inside the foam with the rim's effect; None without one, or not kept
    # strain of the skin under this touch and those solved with it, in place of the stretches above, which are then
    # averages about the punch; None where the stretches and `rim` say all
    surface: SurfaceField | None = None
    # (k,) reference radii, m, at which contact ends in k even directions from +x; None where it is round
    contact_ends_m: Array | None = None
    # what it scatters in place of what its stretches do; None where these say all
    scatterer: Scatterer | None = None

    @property
    def axisymmetric(self) -> bool:
        """Whether the stretches say all of the skin's strain."""
        return self.rim is None and self.surface is None


@dataclass(frozen=True)
class ConductorPart:
    """What conducting punches make of a signal dV, sizes over that of dV, 2-norms."""

    insulated: float  # dV of the same touches if no punch conducted
    own: float  # what conducting changes of it
    end_error: float  # estimated relative error of dV by where the contacts end

    @property
    def grown(self) -> float:
        """How many times a relative error of either part counts in dV; at least once."""
        return max(self.insulated, self.own, 1.0)


@dataclass(frozen=True)
class SignalParts:
    """What several touches, insulated, each make of a signal dV."""

    groups: tuple[tuple[int, ...], ...]  # touches that were solved together, and each of the others
    overlaps: Array  # (groups, groups) |dV_i . dV_j| / |dV|^2 of every group by itself


@dataclass(frozen=True)
class Readings:
    """Electrode voltages of a touched and an untouched skin, in the order of the drive pattern; NaN where a pattern or
    a reading needs an electrode without contact."""

    touched_V: Array  # (patterns, readings) touched, V: baseline_V plus the signal
    baseline_V: Array  # (patterns, readings) untouched, V, the same for every touch on one sensor
    signal_V: Array  # (patterns, readings) signal dV, V; where a mesh is used, both terms on the touch's own
    impedance_Ohm: Array  # (electrodes, electrodes) impedance matrix of the touched skin, Ohm
    signal_error: float  # estimated relative error of signal_V in the 2-norm, discretisation of the electrics only
    skin_fraction_extrapolated: float  # part of the disc whose strain lies outside the range of the conductivity fit
    unknowns: int  # unknowns of the linear system
    cpu_s: float  # CPU time spent, s
    method: str = ""  # how dV was solved: "multipole" or "mesh"
    conductors: ConductorPart | None = None  # None where no punch conducts
    parts: SignalParts | None = None  # None where not needed
    past_law: float = 0.0  # relative change of signal_V by what the skin is where its law is not positive; 0: nowhere


@dataclass(frozen=True)
class Moment:
    """Held touches at one time."""

    # time since the end of loading, s
    time_s: float
    touches: tuple[Touch, ...]  # one a punch
    readings: Readings


@dataclass(frozen=True)
class Result:
    """One scene, solved."""

    outcome: str  # ok, not_converged, bottomed_out or refused
    plan: Plan = field(repr=False)  # what was left out, why, and what that may cost
    # one a punch, at the end of a hold; empty where the mechanics did not converge
    touches: tuple[Touch, ...] = field(default=(), repr=False)
    readings: Readings | None = field(default=None, repr=False)  # None where there are no touches
    # a hold from the end of loading on, increasing in time, the last as in touches and readings; empty without one
    moments: tuple[Moment, ...] = field(default=(), repr=False)
    message: str = ""  # in words, where the outcome is not "ok" or the requested error is missed
    residuals: tuple[float, ...] = ()  # relative residuals of a solver that did not converge; empty otherwise
    # part of the force or depth that such a solver reached; None otherwise, or where it is not known
    load_fraction: float | None = None
    # bounds of what neighbours change of a touch, relative: "signal" and "depth"; empty for one touch
    interaction: Mapping[str, float] = field(default_factory=dict)
    # relative errors: "signal" (dV, everything) and "depth", and others that every touch gives
    error_estimate: Mapping[str, float] = field(default_factory=dict)
    # the part of them that solving left, without what the plan left out
    numerical_error: Mapping[str, float] = field(default_factory=dict)
    # on a curved body: what is made of its surface, at the end of a hold; None on flat ones
    surface: SpaceField | None = field(default=None, repr=False)
    # on a curved body: every touch as it would be alone, upright, without friction on a flat layer; empty on flat ones
    as_if_flat: tuple[Touch, ...] = field(default=(), repr=False)
    # "cpu_s", "compilation_cpu_s" (once, not in it), "wall_s", "peak_MB"
    cost: Mapping[str, float] = field(default_factory=dict)


def of_strain(errors: Array, strain: str) -> float:
    """Of errors (3,) by scene.STRAINS, that of a skin driven by this one; of a layer's, the largest."""
    return float(errors[STRAINS.index(strain)] if strain in STRAINS else np.max(errors))
