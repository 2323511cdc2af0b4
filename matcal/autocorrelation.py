"""How much a correlated series is worth: the integrated autocorrelation time of residuals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def inflation(residual: Array) -> float:
    """Integrated autocorrelation time 1 + 2 sum rho_k of residuals (n,) with known mean 0, at least 1.

    The sum runs to the first window of five times itself (Sokal); n/inflation is the effective number of points.
    """
    n = residual.size
    power = np.abs(np.fft.rfft(residual, 2 * n)) ** 2
    rho = np.fft.irfft(power)[:n]
    if rho[0] == 0:
        return 1.0
    total = 2 * np.cumsum(rho / rho[0]) - 1
    window = np.flatnonzero(np.arange(n) >= 5 * total)
    return float(max(1.0, total[window[0]] if window.size else total.max()))
