"""A touch read from each frame by a tracker."""

from collections.abc import Callable

from surrogate.live.moments import Moment
from surrogate.model.model import Model
from surrogate.model.tracking.tracked import Tracked
from surrogate.model.tracking.tracker import Tracker
from touchcal.arrays import Array


def reader_of(model: Model, untouched_V: Array | None, noise_V: float | None,
              cautions: list[str]) -> Callable[[Moment], Tracked]:
    """Follows frames from an untouched one (or several) and its noise, which the tracker learns where they are not
    given; a new tracker begins where a moment states another noise. `cautions` holds what the present one says of its
    untouched frame."""
    tracker, known = Tracker(model, untouched_V, noise_V, say=cautions.append), noise_V

    def read(moment: Moment) -> Tracked:
        nonlocal tracker, known
        if moment.noise_V is not None and moment.noise_V != known:
            cautions.clear()
            known = moment.noise_V
            tracker = Tracker(model, moment.untouched_V, known, say=cautions.append)
        return tracker.update(moment.volts, moment.time_s)

    return read
