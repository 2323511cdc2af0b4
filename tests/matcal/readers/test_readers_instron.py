"""Instron exports: property lines, units in brackets, quoted thousands, any language and encoding, long holds."""

import time
from pathlib import Path

import numpy as np
import pytest

from matcal.readers.detect import read
from matcal.reduction.reduce import reduce_tests
from touchcal.errors import InputFileError

TIMES = np.arange(40) * 0.5
TRAVELS, FORCES = TIMES * 0.4, 3000 * TIMES / 20
CHINESE = ['试样直径,"50.00",mm', "高度,20.00,mm", "试样标签,foam 3"]
ENGLISH = ['Specimen properties : Diameter,"50.0",mm', "Specimen properties : Anvil height,20.0,mm",
           'Specimen properties : Specimen label,""', "Specimen properties : Final diameter,49.0,mm"]


def _text(properties: list[str], names: str, units: str = "(s),(mm),(N)", scale: float = 1.0) -> str:
    rows = "".join(f'"{t:,.5f}","{x:,.5f}","{f * scale:,.5f}"\n' for t, x, f in
                   zip(TIMES, TRAVELS, FORCES, strict=True))
    return "".join(line + "\n" for line in properties) + "\n" + f"{names}\n{units}\n" + rows


def _write(folder: Path, text: str, encoding: str = "utf-8", name: str = "Specimen_RawData_1.csv") -> Path:
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize(("text", "encoding"), [
    (_text(ENGLISH, "Time,Extension,Load"), "utf-8"),
    (_text(CHINESE, "时间,压缩位移,载荷").replace("\n", "\r\n"), "gb18030"),
    ("\n" + _text(["Durchmesser,50.0,mm", "Höhe,20.0,mm"], "Zeit,Weg,Standardkraft"), "cp1252"),
    (_text(ENGLISH, "Time,Compressive extension,Compressive load", "(s),(mm),(kN)", 1e-3), "utf-8-sig"),
    (_text(["Dimension : Diameter (mm),50", "Dimension : Height (mm),20"], "Time,Displacement,Force"), "utf-8"),
    (_text([], "Time,Extension,Load"), "utf-8"),
], ids=["english", "chinese, CRLF", "german, leading blank", "kN", "unit in the key", "no properties"])
def test_one_record_in_many_exports(text: str, encoding: str, tmp_path: Path) -> None:
    got = read(_write(tmp_path, text, encoding))
    assert got.vendor == "instron"
    np.testing.assert_allclose(got.columns["time"], TIMES)
    np.testing.assert_allclose(got.columns["displacement"], TRAVELS * 1e-3)
    np.testing.assert_allclose(got.columns["force"], FORCES, rtol=1e-6, atol=1e-2)
    if got.metadata:
        assert got.properties == {"diameter": pytest.approx(0.05), "height": pytest.approx(0.02)}


def test_decimal_commas_in_quotes_are_told_from_thousands(tmp_path: Path) -> None:
    rows = "".join(f'"{t:.3f}","{x:.3f}","{f:.3f}"\n'.replace(".", ",") for t, x, f in
                   zip(TIMES, TRAVELS, FORCES, strict=True))
    head = 'Specimen properties : Diameter,"14,0",mm\n\nTime,Extension,Load,Cycle count\n(s),(mm),(N),\n'
    got = read(_write(tmp_path, head + rows.replace("\n", ',"1"\n')))
    np.testing.assert_allclose(got.columns["force"], FORCES)
    assert got.properties == {"diameter": pytest.approx(0.014)}
    np.testing.assert_array_equal(got.columns["cycle"], 1)
    with pytest.raises(InputFileError, match="'2,535' may have a decimal comma or groups of thousands"):
        read(_write(tmp_path, 'Time,Load\n(s),(N)\n"0","1,424"\n"1","2,535"\n'))


def test_two_displacements_that_say_the_same_are_one_and_others_are_refused(tmp_path: Path) -> None:
    def text(second: np.ndarray) -> str:
        rows = "".join(f"{t},{x},{f},{s}\n" for t, x, f, s in zip(TIMES, TRAVELS, FORCES, second, strict=True))
        return "Time,Extension,Load,Position\n(s),(mm),(N),(mm)\n" + rows

    got = read(_write(tmp_path, text(118.0 - TRAVELS)))
    assert any("'Position' left out (the same with its sign turned, shifted by 0.118 m)" in note for note in got.notes)
    with pytest.raises(InputFileError, match=r"are both displacement and differ.*--columns"):
        read(_write(tmp_path, text(np.sqrt(TRAVELS))))


def test_sizes_without_a_unit_or_of_something_else_are_not_used(tmp_path: Path) -> None:
    got = read(_write(tmp_path, _text(["Diameter,50", "Height,20,N", "Width,-3,mm"], "Time,Extension,Load")))
    assert got.properties == {}
    assert any("'Diameter' = 50 is not used as a size: its unit is not stated" in note for note in got.notes)


def test_several_tables_in_one_file_are_refused(tmp_path: Path) -> None:
    table = "Time,Load\n(s),(N)\n0.5,1.5\n1.0,2.5\n"
    with pytest.raises(InputFileError, match="2 tables stand one below the other"):
        read(_write(tmp_path, table + "\n" + table))


def test_a_short_table_of_results_above_the_record_is_not_read_as_one(tmp_path: Path) -> None:
    results = "Results Table 1\nMaximum Force,Modulus\n(N),(MPa)\n123.4,5.6\n\n"
    assert read(_write(tmp_path, results + _text([], "Time,Displacement,Force"))).rows == TIMES.size


def test_a_hold_of_ninety_thousand_rows_is_read_in_seconds(tmp_path: Path) -> None:
    t = np.arange(90_000) * 0.02
    rows = "".join(f'"{a:,.5f}","16.00000","{1500 - a / 2:,.5f}"\r\n' for a in t)
    path = _write(tmp_path, "时间,位移,载荷\r\n(s),(mm),(N)\r\n" + rows, "gb18030")
    started = time.process_time()
    got = read(path)
    assert time.process_time() - started < 4.0
    assert got.rows == t.size
    assert got.columns["force"][-1] == pytest.approx(1500 - t[-1] / 2)


def test_the_method_named_above_the_table_tells_kind_and_direction(tmp_path: Path) -> None:
    travel = np.r_[np.zeros(60), np.linspace(0, 10, 800)]
    rows = "".join(f'"{t:.2f}";"{d:.4f}";"{3 * max(d - 1, 0):.4f}"\n'.replace(".", ",")
                   for t, d in zip(np.arange(travel.size) / 10, travel, strict=True))
    path = tmp_path / "probe_7.csv"
    path.write_text("Prüfart;Druckversuch\nProbendurchmesser;50,0;mm\nProbenhöhe;20,0;mm\n\nZeit;Verschiebung;Last\n"
                    "(s);(mm);(N)\n" + rows, encoding="cp1252")
    test, = reduce_tests([(None, (path,))])
    assert test.kind == "uniaxial"
    assert test.strain.min() == pytest.approx(-9 / 20, abs=0.01)
    assert any("from its own line 'Prüfart: Druckversuch'" in sentence for sentence in test.decisions)
