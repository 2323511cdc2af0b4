"""Whose sizes count: given, the file's own, or beside it; what contradicts is said or refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from matcal.errors import TestFileError
from matcal.geometry import own_sizes, specimen_of
from matcal.readers.recording import Recording
from matcal.specimen import Block

DISC = "[uniaxial]\ndiameter_mm = 50\nheight_mm = 20\ncompliance_mm_per_N = 0.001\n"


def _recording(folder: Path, **sizes: float) -> Recording:
    return Recording((folder / "press.csv",), "instron", {"force": np.zeros(3)}, {"force": "Load"}, {"force": "N"}, 1,
                     properties=sizes)


def _toml(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def test_the_files_own_sizes_serve_alone(tmp_path: Path) -> None:
    block, said, used = specimen_of("uniaxial", _recording(tmp_path, diameter=0.05, height=0.02), None)
    assert isinstance(block, Block)
    assert (block.area_m2, block.length_m) == (pytest.approx(np.pi * 0.05**2 / 4), 0.02)
    assert "the file's own sizes: diameter 50 mm, height 20 mm" in said[0]
    assert used == ()
    assert own_sizes("shear", {"length": 0.02}) is None
    assert own_sizes("planar", {"length": 0.02, "width": 0.1, "thickness": 0.005}) is not None
    with pytest.raises(TestFileError, match=r"press.csv does not state it.*Give --specimen"):
        specimen_of("uniaxial", _recording(tmp_path), None)


def test_what_agrees_is_used_with_its_compliance_and_what_differs_is_refused_or_said(tmp_path: Path) -> None:
    beside = _toml(tmp_path, "specimen.toml", DISC)
    block, said, used = specimen_of("uniaxial", _recording(tmp_path, diameter=0.05, height=0.02), None)
    assert isinstance(block, Block)
    assert block.compliance_m_per_N == pytest.approx(1e-6)
    assert "agrees with what the file itself states" in said[0]
    assert used == (beside,)
    other = _recording(tmp_path, diameter=0.05, height=0.03)
    with pytest.raises(TestFileError, match=r"a length of 30 mm instead of .* 20 mm, as \[uniaxial\] of specimen.toml"):
        specimen_of("uniaxial", other, None)
    block, said, used = specimen_of("uniaxial", other, beside)
    assert isinstance(block, Block)
    assert block.length_m == 0.02
    assert "itself states diameter 50 mm, height 30 mm" in said[1]
    own = _toml(tmp_path, "press.toml", DISC.replace("20", "30"))
    assert specimen_of("uniaxial", other, None)[2] == (own,)
