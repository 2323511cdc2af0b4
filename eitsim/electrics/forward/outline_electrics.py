"""How the readings of a skin with an outline are solved: on meshes that its own solution refines, and circles whose
fields its edges send back."""

import math
from dataclasses import dataclass

import numpy as np

from eitsim.electrics.cem.assembly import Array, SkinMesh
from eitsim.electrics.cem.boundary_integral import Complex
from eitsim.electrics.cem.ring_scattering import Circle, Coupling, admissible_radius, reaches
from eitsim.electrics.outline.adapted_mesh import READINGS, impedance_by_log_contact, solve_untouched
from eitsim.electrics.outline.edge_admittance import (
    CLOSELY,
    EdgeAdmittance,
    edge_admittance,
    sliding_mesh,
)
from eitsim.electrics.outline.edge_admittance import ROUGHLY as ROUGH_SLIDING
from eitsim.electrics.outline.edge_response import arriving, couplings, edge_responses
from eitsim.electrics.outline.ringed_mesh import outlined_mesh
from eitsim.electrics.outline.touch_mesh import fields_mesh, touch_mesh
from eitsim.scene.edges.outline_electrodes import patch_loops
from eitsim.scene.polygons import inside, squared_distance
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Electrodes, Punch

Touches = tuple[tuple[Punch, Touch], ...]

TRIANGLES = 2000  # Of the mesh of fields, about; cells near touches are sampled as the foam's thickness asks.
# Relative errors of dV by "multipole": what no variation shows; by "mesh", what is left over the change by halving
# (second order), where an edge cuts a contact between line electrodes, whose end the mesh follows, and with others.
MISSED, LEFT, LEFT_CUT, LEFT_OTHERS = 2.5e-5, 1 / 3, 0.1, 0.5
# The coarser mesh of a touch: error of the untouched readings outside its rings, and how much thinner these are than
# those of a mesh of quadrilaterals.
ROUGHLY, ROUGH = 5e-3, 1


@dataclass(frozen=True)
class OutlinedSkin:
    """A skin with an outline, methods as those of `DiscSkin`."""

    body: Body
    electrodes: Electrodes
    conductance_S: float

    by_series = True

    def problem(self) -> str:
        """Meshes solve all that may be given."""
        return ""

    def impedance_Ohm(self) -> Array:
        return solve_untouched(self.body.outline, self.electrodes, self.conductance_S, READINGS).impedance_Ohm

    def by_log_contact(self) -> list[Array]:
        """By adjoint fields, which serve all electrodes."""
        return list(impedance_by_log_contact(self.body.outline, self.electrodes, self.conductance_S))

    def slopes(self, places_m: Array) -> Complex:
        circles = [(complex(x, y), 1.0) for x, y in places_m]
        return arriving(edge_responses(self.body.outline, self.electrodes, self.conductance_S)[0], circles, 1)

    def admittance(self, modes: Array, start_S: float, roughly: Electrodes, closely: Electrodes | None
                   ) -> EdgeAdmittance:
        """On a mesh made for a sheet conductance, S, and for electrodes near these, roughly or closely."""
        near, kind = (roughly, ROUGH_SLIDING) if closely is None else (closely, CLOSELY)
        return edge_admittance(sliding_mesh(self.body, near, start_S, kind), self.electrodes, self.conductance_S, modes)

    def fields_mesh(self) -> SkinMesh:
        """One on which the untouched readings are known to FIELDS."""
        return fields_mesh(self.body, self.electrodes, self.conductance_S, self.body.edge.area_m2 / TRIANGLES)

    def image_mesh(self, triangles: int) -> SkinMesh:
        """Of so many triangles or more."""
        return fields_mesh(self.body, self.electrodes, self.conductance_S, self.body.edge.area_m2 / triangles)

    def touched_mesh(self, touches: Touches, level: int = 1) -> SkinMesh:
        return touch_mesh(self.body, self.electrodes, self.conductance_S, touches)

    def needs_mesh(self, touches: Touches) -> bool:
        """Where they are solved together, a neighbour changes them, or an edge that changes them cuts a contact."""
        return not all(touch.axisymmetric for _, touch in touches) and any(
            touch.surface is not None or (touch.rim is not None and touch.rim.neighbour)
            or admissible_radius(self.body, punch) <= touch.contact_radius_m for punch, touch in touches)

    def couplings(self, circles: list[Circle], orders: int) -> tuple[Coupling, list[tuple[Coupling, float]]]:
        """With edges known more roughly."""
        return couplings(self.body.outline, self.electrodes, self.conductance_S, circles, orders)

    def multipole_error(self, cut: float, strain: float, varied: list[float], series: float) -> float:
        """As squares, with what harmonics above would add."""
        return math.hypot(MISSED, cut, strain, *varied, series)

    def touch_mesh(self, touches: Touches) -> SkinMesh:
        return outlined_mesh(self.body, self.electrodes, self.conductance_S, touches)

    def on_patches(self, touches: Touches) -> bool:
        """Whether contacts reach patches that its mesh cannot follow; none."""
        return False

    def rooms_m(self, touches: Touches) -> list[float]:
        out = reaches(self.body, touches)
        for k, loop in enumerate(patch_loops(self.electrodes)):
            ends = np.roll(loop, -1, axis=0)
            for i, (punch, touch) in enumerate(touches):
                place = np.array([punch.x_m, punch.y_m])
                away = float(np.sqrt(squared_distance(place, loop, ends).min()))
                if inside(place, loop, ends) or away <= touch.contact_radius_m:
                    raise ValueError(f"sensitivities are not built for a contact that reaches an electrode, as touch "
                                     f"{i + 1} does number {k} (from 0); move the punch off it.")
                out[i] = min(out[i], away)
        return out

    def sensitivity_mesh(self, touches: Touches) -> tuple[SkinMesh, int]:
        return self.touch_mesh(touches), 1

    def rough_mesh(self, touches: Touches, cut: bool) -> SkinMesh | None:
        """Between line electrodes, where no edge cuts a contact."""
        return None if cut or not self.electrodes.along_edge else outlined_mesh(
            self.body, self.electrodes, self.conductance_S, touches, ROUGHLY, ROUGH)

    def left(self, cut: bool) -> float:
        return LEFT_OTHERS if not self.electrodes.along_edge else LEFT_CUT if cut else LEFT
