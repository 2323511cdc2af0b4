"""The endless data set as one of PyTorch; imported where it is asked for, as PyTorch is of an extra."""

from collections.abc import Iterator
from typing import Any, Protocol

from torch.utils.data import IterableDataset, get_worker_info


class Blocks(Protocol):
    """What has blocks by number."""

    @property
    def first(self) -> int:
        """Block with which they begin."""
        ...

    def block(self, k: int) -> dict[str, Any]:
        """Block k."""
        ...


class TorchFrames(IterableDataset):
    """Blocks of `Frames`; of w workers of a DataLoader each makes every w-th, so that together they make all."""

    def __init__(self, frames: Blocks) -> None:
        super().__init__()
        self.frames = frames

    def __iter__(self) -> Iterator[dict[str, Any]]:
        worker = get_worker_info()
        start, step = (0, 1) if worker is None else (worker.id, worker.num_workers)
        k = self.frames.first + start
        while True:
            yield self.frames.block(k)
            k += step
