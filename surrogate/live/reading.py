"""A touch read from each frame, in the form that the page shows."""

from collections.abc import Callable

import numpy as np

from surrogate.live.messages import Touch
from surrogate.live.moments import Moment
from surrogate.model.predict import Predictor, predict
from surrogate.statistics.conformal import COVERAGE, normal

SHOWN = {"x0": "x_mm", "y0": "y_mm", "d": "d_mm", "F": "F_N"}


def reader_of(predictor: Predictor) -> Callable[[Moment], Touch]:
    """Reads frames one by one as `predict` does."""
    names = predictor.model.names

    def read(moment: Moment) -> Touch:
        found = predict(predictor, moment.volts[None])
        value, half = ({SHOWN[name]: float(part[0, names.index(name)]) for name in SHOWN if name in names
                        and np.isfinite(part[0, names.index(name)])} for part in (found.value, found.half_width))
        sd = np.array([half.get(name, 0.0) for name in ("x_mm", "y_mm")]) / normal(COVERAGE)
        return Touch(value, half, np.diag(sd**2), found.flag[0])

    return read
