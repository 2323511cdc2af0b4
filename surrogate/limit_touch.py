"""The limit at one touch: Cramer-Rao's standard deviations, for an estimator that knows nothing before.

Without a prior they bound every unbiased estimator, and tell what the readings themselves hold; where one exceeds what
was known before, the readings hold nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from eitsim.measurement import below
from surrogate import outputs
from surrogate.limit import Array, correlation, information
from surrogate.limit_material import MaterialSpread
from surrogate.limit_slopes import Derivatives, slopes_of
from surrogate.metrics import rms


def covariance_at(found: Derivatives, spread: MaterialSpread, noise_db: float) -> Array:
    """(..., 4, 4) Cramer-Rao covariance of (x, y, d, F), mm and N, under noise in dB below the RMS of the baseline."""
    noise_V = below(noise_db, rms(found.baseline_V))
    return np.asarray(np.linalg.inv(information(slopes_of(found, spread), noise_V)), np.float64)


def limits_of(found: Derivatives, spread: MaterialSpread, noise_db: float, material: str) -> list[dict[str, Any]]:
    """One row an output: its standard deviation, and the correlation of d and F."""
    covariance = covariance_at(found, spread, noise_db)
    sd, noise_V = np.sqrt(np.diag(covariance)), below(noise_db, rms(found.baseline_V))
    return [{"noise_db": noise_db, "noise_V": noise_V, "material": material, "output": name,
             "unit": outputs.of(name).unit, "limit": float(sd[k]),
             "correlation_d_F": float(correlation(covariance, "d", "F"))}
            for k, name in enumerate(outputs.NAMES[:outputs.TOUCH])]
