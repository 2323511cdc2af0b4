"""Data are synthetic by a line of their own, `touchcal-synthetic: 1`, and by no word that a material may have."""

from pathlib import Path

import pytest

import matcal

ROWS = "strain,stress\n-,kPa\n" + "".join(f"{0.02 * k:g},{0.1 * k:g}\n" for k in range(1, 20))


@pytest.mark.parametrize(("head", "expected"), [
    ("# synthetic foam\n", False), ("# touchcal-synthetic: 1\n", True), ("# touchcal-synthetic: 0\n", False),
    ("# like touchcal-synthetic: 1\n", False), ("touchcal-synthetic: 1\n", True)])
def test_only_the_mark_makes_data_synthetic(head: str, expected: bool, tmp_path: Path) -> None:
    (tmp_path / "shear_synthetic.csv").write_text(head + ROWS)
    card = matcal.fit(f"shear={tmp_path / 'shear_synthetic.csv'}", order=1).card
    assert card.provenance["synthetic"] is expected


@pytest.mark.parametrize("name", ["mts_uniaxial.txt", "mts_shear.txt", "mts_relaxation.txt", "shear.csv"])
def test_generated_files_carry_the_mark_and_their_titles_do_not_count(name: str, tmp_path: Path) -> None:
    text = (Path("data_raw") / name).read_text(encoding="utf-8")
    for mark, expected in (("touchcal-synthetic: 1", 1.0), ("about: synthetic foam", None)):
        (tmp_path / name).write_text(text.replace("touchcal-synthetic: 1", mark), encoding="utf-8")
        assert matcal.read_test(tmp_path / name, "data_raw/specimen.toml").facts.get("synthetic") == expected
