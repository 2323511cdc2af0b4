"""What the page is to say of the untouched frame is that of the tracker which reads now."""

import numpy as np

import surrogate
from surrogate.live.moments import Moment
from surrogate.live.reading import reader_of


def test_cautions_end_with_the_tracker_that_had_them(inner_model: surrogate.Model) -> None:
    own = inner_model.baseline_V
    other = own * (1 + 0.3 * np.sin(np.arange(len(own))))
    cautions: list[str] = []
    read = reader_of(inner_model, other, 1e-5, cautions)
    assert len(cautions) == 1
    read(Moment(0.0, other, noise_V=2e-5, untouched_V=other))
    assert len(cautions) == 1
    read(Moment(0.02, own, noise_V=3e-5, untouched_V=own))
    assert not cautions
