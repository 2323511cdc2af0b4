"""The rim's admittance is the inverse of its impedance, and its derivatives are those of its differences."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.electrics.cem.boundary_integral import rim_admittance, solve_rim
from eitsim.scene.scene import Body, Electrodes

BODY, S = Body(), 1e-3
ANGLES = np.array([0.1, 0.5, 1.2, 2.9, 4.0, 5.5])
IMPEDANCE = np.array([1.0, 0.05, 10.0, 0.3, 2.0, 1.0])
UNEQUAL = Electrodes(count=6, angles_rad=tuple(ANGLES), width_m=(0.01, 0.038, 0.03, 0.002, 0.02, 0.1),
                     contact_impedance_Ohm_m=tuple(IMPEDANCE))
CLOSE = Electrodes(count=16, width_m=0.036, contact_impedance_Ohm_m=0.1)  # gaps of 3 mm


@pytest.mark.parametrize("electrodes", [UNEQUAL, CLOSE, Electrodes()])
def test_admittance_is_the_inverse_of_the_impedance(electrodes: Electrodes) -> None:
    found, count = rim_admittance(BODY, electrodes, S).admittance_S, electrodes.count
    assert np.abs(found.sum(axis=0)).max() < 1e-12 * np.abs(found).max()
    expected = np.linalg.pinv(solve_rim(BODY, electrodes, S).impedance_Ohm)
    assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max(), count


def test_derivatives_are_those_of_differences() -> None:
    found, step = rim_admittance(BODY, UNEQUAL, S), 1e-5
    for k, unit in enumerate(np.eye(6)):
        def at(angle: float, factor: float, unit: np.ndarray = unit) -> np.ndarray:
            moved = replace(UNEQUAL, angles_rad=tuple(ANGLES + angle * unit),
                            contact_impedance_Ohm_m=tuple(IMPEDANCE * np.exp(factor * unit)))
            return rim_admittance(BODY, moved, S).admittance_S

        by_angle = (at(step, 0) - at(-step, 0)) / (2 * step)
        by_impedance = (at(0, step) - at(0, -step)) / (2 * step)
        layer = S * IMPEDANCE[k] / BODY.radius_m
        assert np.abs(found.by_angle[k] - by_angle).max() < 1e-6 * np.abs(by_angle).max()
        assert np.abs(layer * found.by_layer[k] - by_impedance).max() < 1e-6 * np.abs(by_impedance).max()


def test_patches_and_missing_electrodes_are_refused() -> None:
    for electrodes in (Electrodes(kind="patch"), Electrodes(missing=(3,))):
        with pytest.raises(ValueError, match="line electrodes which all have contact"):
            rim_admittance(BODY, electrodes, S)
