"""Whether the curve of a table passes through no stress at no strain, whatever its law.

A sum of hyperfoam terms of many exponents follows any smooth law, and vanishes with the strain. One number more, an
error of the strain's zero, adds its slope; its size and standard error, under errors that may be correlated, say
whether the table's zero is to be trusted.
"""

import numpy as np

from matcal.laws.deformation_modes import design
from matcal.statistics.residual_correlation import correlated_errors
from touchcal.arrays import Array

_ALPHA = np.array([-8.0, -3.0, -1.0, 1.0, 3.0, 6.0, 10.0, 16.0])
_RANK, _STEP = 1e-4, 1e-4  # singular values of the terms, over the largest, that count; step of the slope
_TURNS = 3  # linearisations about the error found before
_FEWEST = 20  # points that show a zero


def zero_of(kind: str, strain: Array, stress: Array) -> tuple[float, float] | None:
    """The error d of a zero, stress = law(strain + d), and its standard error, of a table (n,) of both; None where
    too few points, or none near the zero, show it."""
    reach = float(np.abs(strain).max())
    if strain.size < _FEWEST or np.abs(strain).min() > 0.05 * reach:
        return None
    total, sd = 0.0, 0.0
    for _ in range(_TURNS):
        by, sd = _step(kind, strain + total, stress)
        total += float(np.clip(by, -0.05 * reach, 0.05 * reach))
    return (total, sd) if sd > 0 else None


def _step(kind: str, strain: Array, stress: Array) -> tuple[float, float]:
    """The linearised error of a zero and its standard error; 0 where nothing is left to explain."""
    terms = design(kind, strain, _ALPHA)
    size = np.linalg.norm(terms, axis=0)
    u, s, v = np.linalg.svd(terms / size, full_matrices=False)
    kept = s > _RANK * s[0]
    moduli = v[kept].T @ (u[:, kept].T @ stress / s[kept]) / size
    ahead, behind = (design(kind, strain + h, _ALPHA) @ moduli for h in (_STEP, -_STEP))
    slope = (ahead - behind) / (2 * _STEP)
    slopes = np.column_stack([u[:, kept], slope / np.linalg.norm(slope)])
    gain = np.linalg.pinv(slopes)
    residual = stress - slopes @ (gain @ stress)
    if not np.any(residual):
        return 0.0, 0.0
    (errors,) = correlated_errors([residual], [slopes], np.zeros((slopes.shape[1], slopes.shape[1])), [0.0])
    by, sd = float(gain[-1] @ stress), float(np.sqrt(errors.of(gain)[-1, -1]))
    return by / float(np.linalg.norm(slope)), sd / float(np.linalg.norm(slope))
