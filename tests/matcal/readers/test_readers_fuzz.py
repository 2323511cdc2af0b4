"""Broken files: whatever is done to a file of any layout, reading it ends in finite numbers or in a InputFileError."""

import io
import re
import time
import warnings
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from matcal.readers.column_options import parse_selection
from matcal.readers.detect import read
from matcal.readers.vendors import xlsx
from matcal.reduction.reduce import reduce_tests
from touchcal.errors import InputFileError

ROWS = 120
# CPU seconds that no small file may need, whatever is in it
LONGEST = 5.0
CELLS = ("", "nan", "inf", "-1e308", "1e400", "1,424.96200", "1.424,5", "١٢", "0x1F", "1_000", "strain", "\x00",
         "\ufeff", '"', '"a,b', "100 µA", "#DIV/0!", "=1/0", "(mm)", "mm^99", "N" * 5000, "9" * 400, "-", "Zeit:",
         "Ch 1 Kraft", "WE(1).Current (A)", "10" * 8, "1e-320", "True", "2024-01-01", "e", ".", ",", "+-3", "(" * 7,
         "m" * 60 + "!")


def _curve() -> np.ndarray:
    """(ROWS, 3) time s, displacement mm, force N of a loading and unloading."""
    t = np.linspace(0, 59, ROWS)
    x = 8 * np.sin(np.pi * t / 59) ** 2
    return np.column_stack([t, x, 3 * x + 0.5 * x**2])


def _table(delimiter: str, head: str, decimal: str = ".", ending: str = "\n") -> bytes:
    rows = "".join(delimiter.join(f"{v:.5f}".replace(".", decimal) for v in row) + "\n" for row in _curve())
    return (head + rows).replace("\n", ending).encode()


def _testsuite() -> bytes:
    return _table("\t", "\ufeffFile Path: C:\\foam.txt   \nTest: compression\nTest Run: Run 1\nDate: 1/2/2024\n\n\n"
                        "Time \tCrosshead \tLoad \nsec\tmm\tN\n")


def _mts_793() -> bytes:
    title = "Datenerfassung\t\t\t\t\t\tZeit:\t{}\ts\t28.01.2015 11:00:49\nLaufzeit\tCh 1 Weg\tCh 1 Kraft\ns\tmm\tkN\n"
    rows = ["\t".join(f"{v:.5f}".replace(".", ",") for v in row) + "\n" for row in _curve()]
    return ("MTS793|MPT|DEU|1|2|,|.|:|49|1|1|A\n\nBediener Information\t\t\t\tZeit:\t3,8\ts\t28.01.2015 10:56:24\n"
            "Prüfer : \tKh\nDurchmesser in mm\t50,2\nBediener Information Ende\n\n" + title.format("29,5")
            + "".join(rows[: ROWS // 2]) + "\n" + title.format("60,1") + "".join(rows[ROWS // 2 :])).encode("cp1252")


def _instron() -> bytes:
    rows = "".join(",".join(f'"{v:,.5f}"' for v in row) + "\r\n" for row in _curve() * [1, 1, 20])
    head = "\r\n试样直径,50.0,mm\r\nHeight,\"20.0\",mm\r\n\r\n时间,位移,载荷\r\n(s),(mm),(N)\r\n"
    return (head + rows).encode("gb18030")


def _nova() -> bytes:
    flags = {3: "Current overload"}
    rows = "".join(f"0.5;{t + 1131.9:.4f};{1e-5 * (x + 1):.4E};0.4998;{n};100 µA;{flags.get(n, '')}\n"
                   for n, (t, x, _) in enumerate(_curve()))
    return ("Potential applied (V);Time (s);WE(1).Current (A);WE(1).Potential (V);Index;Current range;Overload\n"
            + rows).encode()


def _book(head: list[list[str]], rows: np.ndarray) -> bytes:
    book = openpyxl.Workbook()
    sheet = book.worksheets[0]
    for row in [*head, *rows.tolist()]:
        sheet.append(row)
    out = io.BytesIO()
    book.save(out)
    return out.getvalue()


SEEDS: dict[str, Callable[[], bytes]] = {
    "uniaxial_compression.txt": _testsuite,
    "uniaxial_specimen.dat": _mts_793,
    "uniaxial_instron.csv": _instron,
    "conductivity_nova.txt": _nova,
    "uniaxial_plain.csv": lambda: _table(",", "# foam 7\nt,strain,stress\ns,%,kPa\n"),
    "shear_commas.csv": lambda: _table(";", "time (s);gamma (%);stress (kPa)\n", ",", "\r\n"),
    "uniaxial_blanks.txt": lambda: _table(" ", "time displacement force\ns mm N\n"),
    "headerless.txt": lambda: _table("\t", ""),
    "uniaxial.xlsx": lambda: _book([["time", "strain", "stress"], ["s", "%", "kPa"]], _curve()),
    "nova.xlsx": lambda: _book([["Time (s)", "WE(1).Potential (V)", "WE(1).Current (A)"]], _curve()),
}


def _flip(data: bytes, rng: np.random.Generator) -> bytes:
    out = bytearray(data)
    for at in rng.integers(0, max(len(out), 1), int(rng.integers(1, 12))):
        if at < len(out):
            out[at] = int(rng.integers(256))
    return bytes(out)


def _cut(data: bytes, rng: np.random.Generator) -> bytes:
    a, b = sorted(rng.integers(0, len(data) + 1, 2))
    ends = [data[:a], data[b:], data[:a] + data[b:], data + data[a:b], b""]
    return ends[int(rng.choice(5, p=[0.3, 0.2, 0.3, 0.15, 0.05]))]


def _lines(data: bytes, rng: np.random.Generator) -> bytes:
    lines = data.split(b"\n")
    for _ in range(int(rng.integers(1, 5))):
        a, b = rng.integers(0, len(lines), 2)
        match int(rng.integers(4)):
            case 0:
                lines[a], lines[b] = lines[b], lines[a]
            case 1:
                lines.insert(int(a), lines[b])
            case 2 if len(lines) > 1:
                del lines[a]
            case _:
                lines[a] = b""
    return b"\n".join(lines)


def _cells(data: bytes, rng: np.random.Generator) -> bytes:
    lines = data.split(b"\n")
    delimiter = max((b"\t", b";", b",", b" "), key=data.count)
    for _ in range(int(rng.integers(1, 6))):
        # the head is where the layout is told, so half of the changes go there
        at = int(rng.integers(0, min(len(lines), 14) if rng.random() < 0.5 else len(lines)))
        cells = lines[at].split(delimiter)
        cells[int(rng.integers(len(cells)))] = str(rng.choice(CELLS)).encode()
        lines[at] = delimiter.join(cells)
    return b"\n".join(lines)


def _encoding(data: bytes, rng: np.random.Generator) -> bytes:
    text = data.decode("latin-1")
    return text.encode(str(rng.choice(["utf-16", "utf-16-le", "utf-8", "utf-32", "cp037"])), "replace")


def _marks(data: bytes, rng: np.random.Generator) -> bytes:
    old, new = rng.choice([b",", b".", b";", b"\t", b'"', b"\n", b"\r\n", b"e", b"(", b"-", b"\x00", b" "], 2)
    return data.replace(bytes(old), bytes(new))


def _numbers(data: bytes, rng: np.random.Generator) -> bytes:
    """Some of the numbers scaled, repeated or taken from elsewhere, so that the file still reads."""
    found = list(re.finditer(rb"-?\d+[.,]\d+", data))
    for k in sorted(rng.integers(0, max(len(found), 1), int(rng.integers(1, 8))), reverse=True):
        if k < len(found):
            new = [found[int(rng.integers(len(found)))][0], b"0", b"1e9", b"-" + found[k][0], found[k][0] + b"E3",
                   found[max(k - 3, 0)][0]][int(rng.integers(6))]
            data = data[:found[k].start()] + new + data[found[k].end():]
    return data


def _archive(data: bytes, rng: np.random.Generator) -> bytes:
    """A workbook whose parts are mutated inside a sound archive; any other file unchanged."""
    if not data.startswith(b"PK"):
        return _numbers(data, rng)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as old:
            parts = {name: old.read(name) for name in old.namelist()}
    except (zipfile.BadZipFile, OSError, zlib.error, EOFError, KeyError, ValueError, RuntimeError):
        return data
    name = sorted(parts)[int(rng.integers(len(parts)))] if rng.random() < 0.5 else "xl/worksheets/sheet1.xml"
    if name in parts:
        body = parts[name].replace(b"><", b">\n<")
        parts[name] = [_numbers, _lines, _flip, _cut][int(rng.integers(4))](body, rng)
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as new:
        for part, body in parts.items():
            new.writestr(part, body)
    return out.getvalue()


SPECIMEN = ("[uniaxial]\ndiameter_mm = 50\nheight_mm = 20\n[relaxation]\ndiameter_mm = 50\nheight_mm = 20\n[shear]\n"
            "faces = 2\nlength_mm = 20\nwidth_mm = 20\nthickness_mm = 5\n[conductivity]\nlength_mm = 60\n"
            "width_mm = 20\nthickness_mm = 5\ncoating_um = 20\n")
MUTATIONS = (_flip, _cut, _lines, _cells, _encoding, _marks, _numbers, _archive)
WEIGHTS = (0.1, 0.1, 0.15, 0.2, 0.05, 0.05, 0.2, 0.15)


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """One to three mutations of a file's bytes, most often one."""
    for _ in range(int(rng.choice((1, 2, 3), p=(0.6, 0.25, 0.15)))):
        data = MUTATIONS[int(rng.choice(len(MUTATIONS), p=WEIGHTS))](data, rng)
    return data


def _survives(path: Path, data: bytes, rng: np.random.Generator, reduce: bool) -> bool:
    """Whether a file of these bytes is read, to finite numbers; fails on any end but that and a InputFileError, or one
    that takes long."""
    path.write_bytes(data)
    started, read_well = time.process_time(), False
    try:
        got = read(path, parse_selection("strain=1,stress=2:kPa") if rng.random() < 0.1 else None)
        assert got.rows > 0
        assert all(np.all(np.isfinite(values)) for values in got.columns.values())
        read_well = True
    except InputFileError:
        pass
    if reduce:
        _reduced(path, rng)
    path.unlink()
    assert time.process_time() - started < LONGEST, f"{path.name} takes too long"
    return read_well


def _reduced(path: Path, rng: np.random.Generator) -> None:
    kind = [None, "uniaxial", "shear", "relaxation", "conductivity"][int(rng.integers(5))]
    try:
        for experiment in reduce_tests([(kind, (path,))]):
            assert np.all(np.isfinite(experiment.strain))
            assert np.all(np.isfinite(experiment.value))
    except InputFileError:
        pass


def test_whole_files_are_read(tmp_path: Path) -> None:
    for name, make in SEEDS.items():
        (tmp_path / name).write_bytes(make())
        if name == "headerless.txt":
            with pytest.raises(InputFileError, match="--columns"):
                read(tmp_path / name)
        else:
            assert read(tmp_path / name).rows >= ROWS - 1


def test_some_broken_files(tmp_path: Path) -> None:
    rng, seeds = np.random.default_rng(1), [(name, make()) for name, make in SEEDS.items()]
    (tmp_path / "specimen.toml").write_text(SPECIMEN)
    tried = [seeds[k % len(seeds)] for k in range(400)]
    well = sum(_survives(tmp_path / name, mutated(data, rng), rng, reduce=k % 20 == 0)
               for k, (name, data) in enumerate(tried))
    assert 20 < well < 300


@pytest.mark.slow
def test_ten_thousand_broken_files(tmp_path: Path) -> None:
    (tmp_path / "specimen.toml").write_text(SPECIMEN)
    whole, well = {name: make() for name, make in SEEDS.items()}, []
    foreign = st.binary(max_size=60) | st.text(max_size=60).map(str.encode)

    @settings(max_examples=10_000, deadline=None, derandomize=True, database=None)
    @given(st.sampled_from(sorted(SEEDS)), st.integers(0, 2**32 - 1), st.none() | st.tuples(st.floats(0, 1), foreign))
    def broken(name: str, seed: int, splice: tuple[float, bytes] | None) -> None:
        rng = np.random.default_rng(seed)
        data = mutated(whole[name], rng)
        if splice is not None and rng.random() < 0.3:
            at = int(splice[0] * len(data))
            data = data[:at] + splice[1] + data[at:]
        well.append(_survives(tmp_path / name, data, rng, reduce=rng.random() < 0.1))

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        broken()
    print(f"{sum(well)} of {len(well)} files read, the others refused")
    assert len(well) >= 10_000
    assert 500 < sum(well) < 7_000


def test_workbook_that_unpacks_to_more_than_the_memory_is_refused(tmp_path: Path,
                                                                  monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xlsx, "_MOST_BYTES", 4_000_000)
    path = tmp_path / "bomb.xlsx"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for n in range(5):
            archive.writestr(f"xl/part{n}.xml", b"0" * 1_000_000)
    with pytest.raises(InputFileError, match="unpacks to 5 MB"):
        read(path)
