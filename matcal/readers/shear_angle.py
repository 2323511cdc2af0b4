"""A shear that is given as an angle: gamma = tan(angle)."""

import re

import numpy as np

from matcal.readers.unit_table import ANGLE, readings
from touchcal.arrays import Array

MOST = 1.45  # rad; no shear test turns its specimen further


def is_angle(unit: str) -> bool:
    """Whether a unit is one of angles."""
    return any(dimensions == ANGLE for _, dimensions in readings(unit))


def names_angle(name: str) -> bool:
    """Whether a column's name is that of an angle, so that a number without a unit may be degrees or radians."""
    return re.search(r"\b(angle|angulo|ángulo|angolo)|winkel", name.lower()) is not None


def is_tensorial(name: str) -> bool:
    """Whether a column's name is that of a component of the strain tensor, of which gamma is twice."""
    pattern = r"\btensor(ial)?\b|^(eps|epsilon|ε|e)[ _]?(xy|xz|yz|yx|zx|zy|12|13|23)$"
    return re.search(pattern, name.strip().lower()) is not None


def gamma_of(angle: Array, unit: str, name: str) -> tuple[Array, str, str]:
    """gamma of angles (n,), rad; what was decided, and what is to be minded where the angle may be gamma itself.
    ValueError for an angle that no shear has."""
    most = float(np.max(np.abs(angle)))
    if most > MOST:
        raise ValueError(f"column '{name}' reaches an angle of {np.degrees(most):.4g} degrees, which no shear has. If "
                         f"it is gamma itself, give it with `columns` strain={name}:-")
    gamma = np.tan(angle)
    said = f"column '{name}' is the shear angle: gamma = tan(angle)."
    far = float(np.max(np.abs(gamma)))
    if readings(unit)[0][0] == np.pi / 180 or far < 1.01 * most:
        return gamma, said, ""
    return gamma, said, (f"Column '{name}' has the unit {unit} and was read as the shear angle: gamma = tan(angle) "
                         f"reaches {far:.3g}, and the angle {most:.3g}. If it is gamma itself, give it with --columns "
                         f"strain={name}:-")
