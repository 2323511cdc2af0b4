"""How the readings of a disc are solved: an integral equation along the rim, and meshes that follow touches."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from eitsim.electrics.cem import ring_scattering as rings
from eitsim.electrics.cem.assembly import Array, SkinMesh, impedance
from eitsim.electrics.cem.boundary_integral import (
    HARMONICS,
    Complex,
    RimAdmittance,
    rim_admittance,
    solve_rim,
    unsolvable,
)
from eitsim.electrics.cem.ring_scattering import Circle, Coupling
from eitsim.electrics.mesh.graded_mesh import triangulation
from eitsim.electrics.mesh.ring_mesh import patch_radii, rim_angles, ring_mesh, template
from eitsim.electrics.mesh.symmetric_mesh import alike_mesh
from eitsim.electrics.outline.patched_disc import patched_disc_mesh, reaches_patches
from eitsim.scene.edges.disc import Disc
from eitsim.scene.electrodes import contact_impedances, identical
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Electrodes, Punch

Touches = tuple[tuple[Punch, Touch], ...]

# Level of the mesh of fields, its rings, and the width of the outermost of these over the radius; the same of that for
# patches, over the radius inside them.
_LEVEL, _RINGS, _LAST = 2, 16, 4e-3
_PATCH_LEVEL, _PATCH_RINGS, _PATCH_LAST = 6, 36, 4e-3
# Level of an image's mesh, its even rings, and those that narrow towards the rim, with the width of the last over the
# radius.
_IMAGE_LEVEL, _EVEN, _NARROWING, _NARROWEST = 2, 28, 8, 2e-3
# Step of the logarithm of a contact impedance; the central difference is off by some step^2, over the derivative.
_STEP = 1e-3
# By how much rings at the lines of the contact are thinner on a mesh for derivatives than on that of readings: force
# and law change the conductance in a ring there that is as thin as the elements of the foam's mesh.
THINNER = 8
_FIELDS_LEVEL = 2  # Level of the mesh of a touched skin's fields.
# Relative errors of dV: by "multipole", what no variation shows; by "mesh", what is left over the change by the last
# halving, where the rim cuts the contact, and elsewhere.
MISSED, LEFT_CUT, LEFT = 3e-5, 0.5, 0.1


@dataclass(frozen=True)
class DiscSkin:
    """A disc and its electrodes that have contact, on a sheet of conductance S, S."""

    body: Body
    electrodes: Electrodes
    conductance_S: float

    # whether errors are taken from rings cut once more and a series of harmonics, else from three quarters of these
    by_series = False

    def problem(self) -> str:
        """Why the electrodes cannot be solved, with the remedy; empty where they can."""
        return unsolvable(self.body, self.electrodes, self.conductance_S) if self.electrodes.along_edge else ""

    def impedance_Ohm(self) -> Array:
        """(N, N), of the untouched skin."""
        if self.electrodes.along_edge:
            return solve_rim(self.body, self.electrodes, self.conductance_S).impedance_Ohm
        return _with_patches(self.body, self.electrodes, self.conductance_S)

    def by_log_contact(self) -> list[Array]:
        """dZ/dlog z_e (N, N), Ohm, of each electrode e, by central differences: two solutions of identical ones, two
        each of others."""
        count = self.electrodes.count
        if not identical(self.electrodes):
            return [self._by_contact(k) for k in range(count)]
        first = self._by_contact(0)
        return [np.roll(first, (k, k), axis=(0, 1)) for k in range(count)]

    def _by_contact(self, k: int) -> Array:
        sides = []
        for step in (_STEP, -_STEP):
            z = contact_impedances(self.electrodes)
            z[k] *= np.exp(step)
            scaled = replace(self.electrodes, **{self.electrodes.impedance_key: tuple(z.tolist())})
            sides.append(replace(self, electrodes=scaled).impedance_Ohm())
        return (sides[0] - sides[1]) / (2 * _STEP)

    def slopes(self, places_m: Array) -> Complex:
        """(places, N) u_x - i u_y, V/m, of the potentials by 1 A into each electrode."""
        driven = solve_rim(self.body, self.electrodes, self.conductance_S).driven
        start, radius = self.electrodes.first_angle_rad, self.body.radius_m
        point = (places_m[:, 0] + 1j * places_m[:, 1]) * np.exp(-1j * start) / radius
        order = np.arange(1, HARMONICS + 1)
        slope = point[:, None] ** (order - 1) @ (order[:, None] * driven) / radius
        return slope * np.exp(-1j * start)

    def admittance(self, modes: Array, start_S: float, roughly: Electrodes, closely: Electrodes | None
                   ) -> RimAdmittance:
        """The admittance of the electrodes on an uneven sheet; other arguments are without effect."""
        return rim_admittance(self.body, self.electrodes, self.conductance_S, modes)

    def fields_mesh(self) -> SkinMesh:
        """The mesh of the untouched skin's potentials."""
        angles, electrode = rim_angles(self.body, self.electrodes, _LEVEL)
        radii = self.body.radius_m * np.append(1 - np.geomspace(1, _LAST, _RINGS), 1.0)
        return ring_mesh(radii, np.zeros((len(radii), 2)), angles, electrode, self.electrodes.count)

    def image_mesh(self, triangles: int) -> SkinMesh:
        """Rings about the middle, fine enough for pixels inside and for the electrodes' edges."""
        angles, electrode = rim_angles(self.body, self.electrodes, _IMAGE_LEVEL)
        patches = patch_radii(self.body, self.electrodes, _IMAGE_LEVEL)
        inner = np.linspace(0, 1, _EVEN + 1)[:-1]
        narrowing = 1 - np.geomspace(1 - inner[-1], _NARROWEST, _NARROWING + 1)[1:]
        radii = np.concatenate([patches[0] * inner, patches[0] * narrowing, patches])
        return ring_mesh(radii, np.zeros((len(radii), 2)), angles, electrode, self.electrodes.count,
                         covered=len(patches) - 1)

    def touched_mesh(self, touches: Touches, level: int = _FIELDS_LEVEL) -> SkinMesh:
        """The mesh of a touched skin's fields, or one as fine as its level."""
        if self.on_patches(touches):
            return patched_disc_mesh(self.body, self.electrodes, touches)
        return following_mesh(self.body, self.electrodes, touches, level)

    def needs_mesh(self, touches: Touches) -> bool:
        """Whether circles cannot hold what touches scatter: on a disc where the rim or a neighbour changes them."""
        return not all(touch.axisymmetric for _, touch in touches)

    def couplings(self, circles: list[Circle], orders: int) -> tuple[Coupling, list[tuple[Coupling, float]]]:
        """What couples circles on the skin, and that with fewer harmonics around the rim."""
        rim = solve_rim(self.body, self.electrodes, self.conductance_S)
        whole, fewer = (rings.on_disc(rim, self.body, self.electrodes, circles, orders, harmonics)
                        for harmonics in (HARMONICS, 3 * HARMONICS // 4))
        return whole, [(fewer, 1.0)]

    def multipole_error(self, cut: float, strain: float, varied: list[float], series: float) -> float:
        """By the rings, the strain outside them and fewer harmonics."""
        return MISSED + cut + sum(varied) + strain

    def touch_mesh(self, touches: Touches) -> SkinMesh:
        """The mesh that dV is taken on, to be halved."""
        if self.on_patches(touches):
            return patched_disc_mesh(self.body, self.electrodes, touches)
        return alike_mesh(self.body, self.electrodes, touches)

    def on_patches(self, touches: Touches) -> bool:
        """Whether contacts reach patches, which a mesh of rings cannot follow."""
        return reaches_patches(self.body, self.electrodes, touches)

    def rooms_m(self, touches: Touches) -> list[float]:
        """Radii, m, of the circles about the punches in which nodes of that mesh may move, free of edges and
        electrodes; ValueError where a contact leaves them."""
        return rings.reaches(Body(Disc(float(patch_radii(self.body, self.electrodes)[0]))), touches)

    def sensitivity_mesh(self, touches: Touches) -> tuple[SkinMesh, int]:
        """The mesh that derivatives are taken on, to be halved, and how often that is done already."""
        return alike_mesh(self.body, self.electrodes, touches, thinner=THINNER), 0

    def rough_mesh(self, touches: Touches, cut: bool) -> SkinMesh | None:
        """A coarser mesh that shows the error; none."""
        return None

    def left(self, cut: bool) -> float:
        """What is left over the change by the last halving; cut: whether the edge cuts a contact."""
        return LEFT_CUT if cut else LEFT


def following_mesh(body: Body, electrodes: Electrodes, touches: Touches, level: int) -> SkinMesh:
    """The mesh of a disc that follows one touch (`template`) or several (`triangulation`), on a level."""
    if len(touches) == 1:
        return template(body, electrodes, *touches[0], level)
    return triangulation(body, electrodes, touches, level)


@lru_cache(maxsize=8)
def _with_patches(body: Body, electrodes: Electrodes, conductance_S: float) -> Array:
    angles, electrode = rim_angles(body, electrodes, _PATCH_LEVEL)
    patches = patch_radii(body, electrodes, _PATCH_LEVEL)
    inside = 1 - np.geomspace(1, _PATCH_LAST, _PATCH_RINGS)
    radii = np.concatenate([patches[0] * inside, patches])
    mesh = ring_mesh(radii, np.zeros((len(radii), 2)), angles, electrode, electrodes.count, covered=len(patches) - 1)
    z = impedance(mesh, np.full(len(mesh.cells), conductance_S), contact_impedances(electrodes))
    z.flags.writeable = False
    return z
