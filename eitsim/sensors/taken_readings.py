"""Frames whose readings of driven electrodes hold no measurement, and the drive without these readings.

Some boards leave them at 0, empty, or at the end of their range; everywhere else such a reading is dead.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from eitsim.scene.drive import Drive, Protocol, as_tuples
from eitsim.scene.drive import protocol as protocol_of
from eitsim.scene.frames import Frames
from eitsim.scene.scene import Scene
from eitsim.sensors.formats.open_file import open_frames, open_recording
from eitsim.sensors.order_evidence import not_taken_of
from eitsim.sensors.recording import in_phase
from eitsim.sensors.unmeasured import unmeasured
from touchcal.arrays import Mask
from touchcal.errors import InputFileError

Reader = Callable[[Path, int, Mask], Frames]


def taken(path: Path, scene: Scene) -> tuple[Scene, Reader, int]:
    """The scene whose drive makes the readings that a file of its frames holds, a reader of these, and how many
    readings of driven electrodes are left out of both."""
    asked = protocol_of(scene.drive, scene.electrodes.count)
    try:
        held = in_phase(open_recording(path, readings=asked.shape[0] * asked.shape[1]).readings)
    except InputFileError:  # a file in another order of columns, or one that its own reader refuses
        return scene, open_frames, 0
    idle = idle_readings(asked, unmeasured(held))
    if not idle.any() or idle.all():
        return scene, open_frames, 0

    def read(path: Path, readings: int, unread: Mask) -> Frames:
        lost = idle.copy()
        lost[~idle] = unread
        found = open_frames(path, idle.size, lost)
        return Frames(found.volts[:, ~idle], found.line)

    return replace(scene, drive=_without(asked, scene.drive.current_A, idle)), read, int(idle.sum())


def idle_readings(asked: Protocol, silent: Mask) -> Mask:
    """(m,) which of the readings that hold no measurement (m,) a board does not take under a drive."""
    carries = np.abs(asked.currents_A) > 1e-9 * np.abs(asked.currents_A).max(axis=1, keepdims=True)
    read = asked.weights != 0
    any_driven = (read & carries[:, None]).any(axis=2).ravel()
    all_driven = (~read | carries[:, None]).all(axis=2).ravel()
    return not_taken_of((any_driven, all_driven), silent)


def _without(asked: Protocol, current_A: float, idle: Mask) -> Drive:
    """The drive without some readings (m,): a pattern each where patterns are left with other numbers of them."""
    kept = ~idle.reshape(asked.shape)
    each = kept.sum(axis=1)
    currents = asked.currents_A / current_A
    if (each == each[0]).all():
        weights = [part[take].tolist() for part, take in zip(asked.weights, kept, strict=True)]
        return Drive(current_A=current_A, currents=as_tuples(currents), measurements=as_tuples(weights))
    return Drive(current_A=current_A, currents=as_tuples(np.repeat(currents, each, axis=0)),
                 measurements=as_tuples(asked.weights[kept][:, None]))
