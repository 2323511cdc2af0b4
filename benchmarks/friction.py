"""What sticking does to depths: frictionless and sticking, at fifteen punches and forces of Table 1.

Depths, the errors that the solution states, how much slips, and CPU seconds into results/friction.csv. Pin threads to
one as `make bench` does.
"""

import itertools

from conditions import quick, shown, written
from materials import TABLE_1

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.scene import Body, Punch

DIAMETERS_MM, FORCES_N = (10, 14, 18), quick((0.1, 0.5, 1.0, 2.0, 3.0), (1.0,))
FRICTIONS = (("none", 0.0), ("stick", 0.0))


def row(diameter_mm: float, force_N: float, friction: str, coefficient: float) -> dict[str, object]:
    """One touch."""
    punch = Punch(diameter_m=diameter_mm * 1e-3, force_N=force_N, friction=friction, friction_coefficient=coefficient)
    touch = solve_touch(TABLE_1, Body(), punch)
    return {"d_mm": diameter_mm, "F_N": force_N, "friction": friction, "coefficient": coefficient,
            "depth_mm": f"{touch.depth_m * 1e3:.5f}", "depth_error": f"{touch.depth_error:.1e}",
            "signal_error": f"{touch.signal_errors[0]:.1e}", "slip_fraction": touch.slip_fraction,
            "fraction_non_elliptic": f"{touch.fraction_non_elliptic:.1e}", "cpu_s": f"{touch.cpu_s:.2f}"}


def main() -> None:
    """Solve and write all rows."""
    solve_touch(TABLE_1, Body(), Punch())
    cases = itertools.product(DIAMETERS_MM, FORCES_N, FRICTIONS)
    rows = [row(diameter, force, *friction) for diameter, force, friction in cases]
    shown(written(rows, "friction"))


if __name__ == "__main__":
    main()
