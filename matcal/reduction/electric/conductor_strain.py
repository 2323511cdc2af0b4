"""How far a conductor is strained, by its own column or by the travel, and whether it is pressed or pulled."""

from collections.abc import Sequence

import numpy as np

from matcal.readers.recording import Recording
from matcal.reduction.loading_direction import SIGNS, named_direction, words_about
from matcal.reduction.measured_twice import best_measures, counted_down
from matcal.reduction.specimen import Block, Strip
from touchcal.arrays import Array
from touchcal.errors import InputFileError


def with_travel(recording: Recording, strip: Strip) -> tuple[Recording, tuple[str, ...], tuple[str, ...]]:
    """The recording with its displacement, strain x length where the strain has its own column; decisions and cautions.
    InputFileError where neither is there, or both contradict the length."""
    if not {"strain", "stretch", "displacement"} & set(recording.columns):
        raise InputFileError(recording.paths[0], f"{', '.join(recording.names.values())} say nothing of the strain. "
                                                 "Give the frame's file as well: conductivity=FRAME_FILE,"
                                                 "POTENTIOSTAT_FILE.")
    used = best_measures(recording, Block(0.0, strip.length_m))
    return used.recording, used.decisions, used.cautions


def side_of(recordings: Sequence[Recording], strip: Strip) -> tuple[float, tuple[str, ...], tuple[str, ...]]:
    """-1 for compression and 1 for tension, decisions and cautions: by the specimen, by names, or by columns that count
    compression as negative; InputFileError for a block of which nothing tells."""
    if strip.direction is not None:
        return SIGNS[strip.direction], (f"{strip.direction.capitalize()}, as the specimen says.",), ()
    named = named_direction([word for r in recordings for word in words_about(r)]) or named_direction(
        [name for r in recordings for name in r.names.values()])
    if named is not None:
        return SIGNS[named], (f"{named.capitalize()}, from the test's own name.",), ()
    if any(counted_down(r.columns) for r in recordings):
        return -1.0, ("Compression, as its columns count downwards.",), ()
    fix = "Write direction = \"compression\" or \"tension\" below [conductivity] of the specimen file."
    label = " and ".join(dict.fromkeys(r.label for r in recordings))
    if not strip.coated:
        raise InputFileError(recordings[0].paths[0], f"nothing tells whether this is compression or tension. {fix}")
    return 1.0, (), (f"Nothing tells compression from tension in {label}: it was read as tension, as a coated strip is "
                     f"pulled. {fix}",)


def strain_of_rows(recording: Recording, strip: Strip) -> tuple[Array, tuple[str, ...], tuple[str, ...]]:
    """(n,) strain of a table row by row, compression negative, from its first row on where it is a travel; decisions
    and cautions."""
    made, said, cautions = with_travel(recording, strip)
    strain = made.columns["displacement"] / strip.length_m
    if not {"strain", "stretch"} & set(recording.columns):
        strain = strain - strain[0]
    side, why, more = side_of([recording], strip)
    if strain[int(np.argmax(np.abs(strain)))] * side < 0:
        strain = -strain
    if strain.min() <= -1:
        raise InputFileError(recording.paths[0], f"a strain of {strain.min():.3g} is not possible. Check length_mm and "
                                                 "the unit of the strain.")
    return strain, (*said, *why), (*cautions, *more)
