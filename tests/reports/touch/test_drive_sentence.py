"""The sentence on the drive says what the matrices of that drive do."""

import numpy as np
import pytest

from eitsim.scene.drive import Drive, protocol
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import scene_from, scene_tables
from reports.touch.drive_sentence import drive_sentence


def sentence(**drive: object) -> str:
    return drive_sentence(scene_tables(scene_from({"punch": {"x_mm": 20}, "drive": drive}))["drive"])


@pytest.mark.parametrize(("pattern", "sink", "words"), [
    ("adjacent", 1, "takes it out at k + 1;"), ("opposite", 8, "takes it out at the opposite one;"),
    ("skip-2", 3, "takes it out at k + 3;")])
def test_the_sink_is_that_of_the_pattern(pattern: str, sink: int, words: str) -> None:
    assert words in sentence(pattern=pattern)
    assert np.argmin(protocol(Drive(pattern=pattern), Electrodes().count).currents_A[0]) == sink
