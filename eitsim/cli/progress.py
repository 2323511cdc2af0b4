"""How far a sweep is: a bar on a terminal; in a pipe nothing, or a line now and then where that is asked for."""

import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from eitsim.sweeps.run.sweep import Progress
from touchcal.terminal import counter


@contextmanager
def shown(scenes: int, log_every_s: float = 0.0) -> Iterator[Callable[[Progress], None]]:
    """A function that shows a Progress on standard error: on a terminal, and elsewhere in lines, one each `log_every_s`
    at most; 0 for none."""
    if not log_every_s >= 0:
        raise ValueError(f"--log-every must be 0 (no lines) or a number of seconds above it, got {log_every_s:g}.")
    begun = said = time.monotonic()
    with counter(scenes, "scenes") as advance:
        def show(step: Progress) -> None:
            nonlocal said, begun
            now = time.monotonic()
            advance(step.done, bar_text(step, now - begun))
            if not (sys.stderr.isatty() or log_every_s):
                return
            if step.stage == "table":
                print("load paths first: from the cache, or solved once for this foam and its punches", file=sys.stderr)
            elif step.done == step.kept:
                begun = now
            elif not sys.stderr.isatty() and now >= said + log_every_s:
                print(line(step, now - begun), file=sys.stderr, flush=True)
                said = now
        yield show


def line(step: Progress, spent_s: float) -> str:
    """Done, rate, time left, outcomes and signal errors, in words; `spent_s` on the rows of this call."""
    rate = _rate(step, spent_s)
    left = f"{(step.scenes - step.done) / rate / 60:.1f} min left" if rate else "time left unknown"
    parts = [f"{step.done} of {step.scenes} scenes, {rate:.3g} a second, {left}", in_words(step.outcomes)]
    if step.signal_error is not None:
        median, most = step.signal_error
        parts.append(f"signal error {100 * median:.3g} % in the median, 95 % below {100 * most:.3g} %")
    return "; ".join(filter(None, parts))


def bar_text(step: Progress, spent_s: float) -> str:
    """What of a line the bar on a terminal does not tell, as short as 80 columns ask; errors are the median and what
    95 % lie below."""
    rate = _rate(step, spent_s)
    parts = [f"{rate:.3g}/s" if rate else "", in_words(step.outcomes)]
    if step.signal_error is not None:
        parts.append(f"error {100 * step.signal_error[0]:.2g} < {100 * step.signal_error[1]:.2g} %")
    return ", ".join(filter(None, parts))


def _rate(step: Progress, spent_s: float) -> float:
    return (step.done - step.kept) / max(spent_s, 1e-9)


def in_words(outcomes: Mapping[str, int]) -> str:
    """Counts of outcomes."""
    return ", ".join(f"{n} {name}" for name, n in sorted(outcomes.items()))
