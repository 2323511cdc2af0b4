"""Sizes that stand above a plain table are the specimen's, in the words of several machines."""

from pathlib import Path

import pytest

from matcal.readers.detect import read

ROWS = "".join(f"{0.1 * k}\t{0.5 * k}\t{2 * k}\n" for k in range(12))


@pytest.mark.parametrize(("head", "sizes"), [
    ('"Probenbreite b0"\t11.4\t"mm"\n"Probendicke a0"\t0.2\t"mm"\n"Messlänge"\t"nicht bekannt"\n',
     {"width": 0.0114, "thickness": 0.0002}),
    ('"Specimen width"\t30\t"mm"\n"Anvil height"\t12.5\t"mm"\n', {"width": 0.03, "height": 0.0125}),
    ("Diameter (mm)\t50\nGauge length L0\t80\tmm\n", {"diameter": 0.05, "length": 0.08}),
    ("Width\t30\n", {})])
def test_sizes_above_a_table(head: str, sizes: dict[str, float], tmp_path: Path) -> None:
    path = tmp_path / "uniaxial.txt"
    path.write_text(head + "Time\tDisplacement\tForce\ns\tmm\tN\n" + ROWS, encoding="utf-8")
    got = read(path)
    assert got.properties == pytest.approx(sizes)
    assert got.rows == 12
