"""Electrodes equal and not, narrow to touching, 4 to 64: cost of the untouched skin, and dV by two methods.

CPU seconds of the first rim and of the next conductance, the 2-norm of the difference between dV by rings and by the
mesh that follows the touch, and the error that each states. Run by `make bench`; writes
results/electrodes.csv next to this file.
"""

import time

import numpy as np
from conditions import quick, shown, written

from eitsim.electrics.cem.boundary_integral import solve_rim
from eitsim.electrics.forward.solve_forward import solve
from eitsim.scene.electrodes import Electrodes, present
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Drive, Punch, Skin
from matcal.laws.conductivity import Conductivity

BODY, LAW, PUNCH = Body(), Conductivity(30.0, [-2, 2, -1], (-0.5, 0.4)), Punch(0.03, 0.02)
RIM_M = 2 * np.pi * BODY.radius_m


def unlike(count: int, narrow_m: float, wide_m: float) -> Electrodes:
    """Widths and contact impedances that rise around the ring."""
    return Electrodes(count=count, width_m=tuple(np.linspace(narrow_m, wide_m, count).tolist()),
                      contact_impedance_Ohm_m=tuple(np.geomspace(1e-3, 1e2, count).tolist()))


CASES = {
    "16 of 10 mm": Electrodes(),
    "16 of 0.5 mm": Electrodes(width_m=5e-4),
    "16 touching": Electrodes(width_m=RIM_M / 16),
    "4 of 150 mm": Electrodes(count=4, width_m=0.15),
    "64 of 5 mm": Electrodes(count=64, width_m=5e-3),
    "64 touching": Electrodes(count=64, width_m=RIM_M / 64),
    "16, 1e-9 Ohm m": Electrodes(contact_impedance_Ohm_m=1e-9),
    "16, 1e6 Ohm m": Electrodes(contact_impedance_Ohm_m=1e6),
    "16 of 2 to 30 mm, 1e-3 to 1e2 Ohm m": unlike(16, 2e-3, 3e-2),
    "64 of 0.5 to 5 mm, 1e-3 to 1e2 Ohm m": unlike(64, 5e-4, 5e-3),
    "16 of 10 mm, one missing": Electrodes(missing=(4,)),
    "16 touching, one missing": Electrodes(width_m=RIM_M / 16, missing=(4,)),
}


def pressed() -> Touch:
    """A touch that squeezes the skin under a punch of 14 mm to 0.7 of its thickness."""
    radius = np.linspace(0, 0.03, 121)
    normal = 1 - 0.3 / (1 + (radius / 0.007) ** 8)
    rest = np.ones_like(radius)
    return Touch(radius, 0 * rest, 0 * rest, rest, rest, normal, 0 * rest, contact_radius_m=0.007, force_N=0.0,
                 depth_m=0.0, sigma_max_Pa=0.0, sigma_ave_Pa=0.0, contact_area_m2=0.0, wall_contact_m2=0.0,
                 depth_error=0.0, signal_errors=np.zeros(3), fraction_non_elliptic=0.0, iterations=0, residuals=(),
                 cpu_s=0.0)


def rim_cost(electrodes: Electrodes, conductance_S: float) -> float:
    start = time.process_time()
    solve_rim(BODY, present(electrodes), conductance_S)
    return time.process_time() - start


def measured(name: str, electrodes: Electrodes) -> dict[str, object]:
    costs = [rim_cost(electrodes, s) for s in (5e-4, 5.5e-4)]
    rings, mesh = (solve(BODY, Skin(), electrodes, Drive(), ((PUNCH, pressed()),), LAW, method=method, signal=2e-3)
                   for method in ("multipole", "mesh"))
    kept = np.isfinite(rings.signal_V)
    difference = np.linalg.norm((rings.signal_V - mesh.signal_V)[kept]) / np.linalg.norm(rings.signal_V[kept])
    return {"electrodes": name, "rim_first_cpu_s": costs[0], "rim_next_cpu_s": costs[1], "dV_rings_to_mesh": difference,
            "told_rings": rings.signal_error, "told_mesh": mesh.signal_error, "rings_cpu_s": rings.cpu_s,
            "mesh_cpu_s": mesh.cpu_s}


def main() -> None:
    solve(BODY, Skin(), Electrodes(count=5), Drive(), ((PUNCH, pressed()),), LAW, method="mesh", signal=0.1)
    rows = [measured(name, electrodes) for name, electrodes in [*CASES.items()][:quick(None, 4)]]
    shown(written(rows, "electrodes", 3))


if __name__ == "__main__":
    main()
