"""Ending early as a terminal, a batch system or a closed session asks for it, with everything put away."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_ASKING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Stopped(BaseException):
    """The process was asked to end."""

    def __init__(self, number: int) -> None:
        self.signal = signal.Signals(number)
        super().__init__(self.signal.name)

    @property
    def status(self) -> int:
        """Exit status by the custom of shells."""
        return 128 + self.signal


@contextmanager
def stoppable() -> Iterator[None]:
    """Within, Ctrl-C, SIGTERM and a closed terminal raise Stopped, the first of them only; main thread alone."""
    before = {number: signal.getsignal(number) for number in _ASKING}
    heard = [number for number, handler in before.items() if handler != signal.SIG_IGN]

    def stop(number: int, _: FrameType | None) -> None:
        for one in heard:
            signal.signal(one, signal.SIG_IGN)
        raise Stopped(number)

    for number in heard:
        signal.signal(number, stop)
    try:
        yield
    finally:
        for number in heard:
            signal.signal(number, before[number])


@contextmanager
def silent_interrupt() -> Iterator[None]:
    """Within, Ctrl-C ends the process at once and without a word, as suits imports, before anything is begun."""
    before = signal.getsignal(signal.SIGINT)
    if before != signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
