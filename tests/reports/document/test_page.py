import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from pypdf import PdfReader
from pypdf.generic import DictionaryObject

from reports.document import provenance, style
from reports.document.page import Report, ReportFigure, Table, write_pdf

Reader = Callable[[Path], Any]


def plate(name: str, x: str = "Time (s)", height_mm: float = 40, width_mm: float = style.TEXT_WIDTH_MM) -> ReportFigure:
    with style.house():
        figure = style.sheet(height_mm, width_mm)
        axes = figure.subplots()
        axes.plot([0, 1], [2, -3])
        style.label(axes, x, "Force (N)")
    return ReportFigure(name, figure, "It falls by 5 N.", {name: pd.DataFrame({"t_s": [0, 1], "F_N": [2, -3]})})


def make_report(tmp_path: Path, *plates: ReportFigure, **changes: Any) -> Report:
    source = tmp_path / "input.json"
    source.write_text("{}")
    footer = provenance.footer([provenance.source(source)], provenance.seed_words(11))
    return replace(Report("touch", "Title", "Subtitle", footer, ["A finding."], plates,
                          absent={"readings": "No voltages here."}), **changes)


def render(report: Report, out: Path) -> None:
    with style.house():
        write_pdf(report, out)


def test_a_report_drawn_again_has_the_same_bytes_and_no_date(tmp_path: Path) -> None:
    for name in ("a.pdf", "b.pdf"):
        render(make_report(tmp_path, plate("scene")), tmp_path / name)
    drawn = (tmp_path / "a.pdf").read_bytes()
    assert drawn == (tmp_path / "b.pdf").read_bytes()
    assert b"CreationDate" not in drawn


@pytest.mark.parametrize(("width_mm", "pages"), [(style.HALF_WIDTH_MM, 2), (style.TEXT_WIDTH_MM, 3)])
def test_figures_of_half_the_width_stand_two_in_a_row(tmp_path: Path, width_mm: float, pages: int) -> None:
    names = [f"figure_{k}" for k in range(6)]
    plates = [plate(name, height_mm=95, width_mm=width_mm) for name in names]
    template = Path(__file__).parents[3] / "benchmarks" / "report" / "precision.typ"
    render(make_report(tmp_path, *plates, template=template, prose={"order": names}), tmp_path / "a.pdf")
    assert len(PdfReader(tmp_path / "a.pdf").pages) == pages


def test_every_font_is_embedded_and_the_page_is_a4(tmp_path: Path) -> None:
    out = tmp_path / "a.pdf"
    render(make_report(tmp_path, plate("scene")), out)
    reader = PdfReader(out)
    assert [round(float(v)) for v in reader.pages[0].mediabox[2:]] == [595, 842]
    objects = [reader.get_object(i) for i in range(1, int(str(reader.trailer["/Size"])))]
    dictionaries = [o for o in objects if isinstance(o, DictionaryObject)]
    fonts = [o for o in dictionaries if o.get("/Type") == "/Font" and o.get("/Subtype") != "/Type0"]
    names = " ".join(str(font["/BaseFont"]) for font in fonts)
    assert "STIXGeneral-Regular" in names
    assert "LibertinusSerif-Regular" in names
    for font in fonts:
        descriptor = font["/FontDescriptor"]
        assert isinstance(descriptor, DictionaryObject)
        assert {"/FontFile", "/FontFile2", "/FontFile3"} & descriptor.keys()


def test_strings_are_text_and_never_markup(tmp_path: Path, read_pdf: Reader) -> None:
    out, sharp = tmp_path / "a.pdf", "#panic() $x^2$ *bold* _it_ \\ [a] `b` <c> @d"
    render(make_report(tmp_path, findings=[sharp], title=sharp), out)
    assert read_pdf(out).whole.count(sharp) == 2


def test_footer_carries_hash_seed_commit_and_machine_on_every_page(tmp_path: Path, read_pdf: Reader) -> None:
    out = tmp_path / "a.pdf"
    table = Table("Many rows.", ["a"], [["x"]] * 120, "w")
    report = make_report(tmp_path, tables={"plan": table})
    render(report, out)
    pages = read_pdf(out).pages
    assert len(pages) > 1
    for page in pages:
        line = " ".join(page.split())
        assert report.footer["inputs"][0]["sha256"][:16] in line
        assert "seed 11" in line
        assert "commit" in line
        assert "core" in line


def test_a_long_file_name_wraps_inside_its_cell(tmp_path: Path, read_pdf: Reader) -> None:
    name, digest = "_".join(["very", "long"] * 12) + ".txt", "ab" * 32
    table = Table("Files.", ["file", "sha256"], [[name, digest], ["short_name.txt", digest]], "wl")
    render(make_report(tmp_path, tables={"plan": table}), tmp_path / "a.pdf")
    text = read_pdf(tmp_path / "a.pdf").whole
    assert name not in text
    assert name in text.replace(" ", "")
    assert "short_name.txt" in text
    assert text.count(digest) == 2


def test_what_is_absent_is_said(tmp_path: Path, read_pdf: Reader) -> None:
    render(make_report(tmp_path), tmp_path / "a.pdf")
    assert "No voltages here." in read_pdf(tmp_path / "a.pdf").whole


@pytest.mark.usefixtures("svg_too")
def test_figures_lie_beside_the_page_and_old_ones_go(tmp_path: Path) -> None:
    out, files = tmp_path / "a.pdf", tmp_path / "a_files"
    render(make_report(tmp_path, plate("scene"), plate("readings")), out)
    (files / "mine.csv").write_text("kept\n")
    render(make_report(tmp_path, plate("scene")), out)
    assert sorted(p.name for p in files.iterdir()) == ["contents.json", "mine.csv", "scene.csv", "scene.svg"]
    assert (files / "scene.csv").read_text() == "t_s,F_N\n0,2\n1,-3\n"
    assert (files / "scene.svg").read_text().rstrip().endswith("</svg>")
    assert json.loads((files / "contents.json").read_text())["files"] == ["scene.svg", "scene.csv"]


def test_errors_name_what_was_wrong(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="does not exist"):
        render(make_report(tmp_path), tmp_path / "nowhere" / "a.pdf")
    with pytest.raises(RuntimeError, match=r"template touch\.typ .*software"):
        render(make_report(tmp_path, footer={"inputs": []}), tmp_path / "a.pdf")
    assert not (tmp_path / "a.pdf").exists()
    with pytest.raises(ValueError, match="'Time' has no unit"):
        plate("scene", "Time")
    with pytest.raises(ValueError, match="one width"):
        Table("Two heads, one column.", ["a", "b"], [["x"]], "l")


def test_a_character_without_a_glyph_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(UserWarning, match="missing"):
        render(make_report(tmp_path, plate("scene", "温度 (K)")), tmp_path / "a.pdf")


def test_the_house_style_leaves_no_trace() -> None:
    before = dict(matplotlib.rcParams)
    with style.house():
        assert dict(matplotlib.rcParams) != before
    assert dict(matplotlib.rcParams) == before


@pytest.mark.thorough
def test_reports_leave_pyplot_alone() -> None:
    code = (
        "import sys, reports.sweep.sweep_report, reports.calibration.calibration_report; "
        "import reports.surrogate.surrogate_report; "
        "sys.exit(any(m in sys.modules for m in ('matplotlib.pyplot', 'torch', 'emcee', 'arviz', 'skfem')))"
    )
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_one_hash_for_many_files_depends_on_names_and_bytes_only(tmp_path: Path) -> None:
    for name, text in (("a", "1"), ("b", "2")):
        (tmp_path / name).write_text(text)
    first, second = provenance.source(tmp_path / "a"), provenance.source(tmp_path / "b")
    assert first.sha256 == "6b86b273ff34fce19d6b804eff5a3f5747ada4eaa22f1d49c01e52ddb7875b4b"
    assert provenance.combined("x", [first, second]) == provenance.combined("x", [second, first])
    assert provenance.combined("x", [first]).sha256 != provenance.combined("x", [second]).sha256


@pytest.mark.parametrize(("spoil", "words"), [
    (lambda axes: None, None), (lambda axes: axes.set_xlabel("Time"), "'Time' has no unit"),
    (lambda axes: axes.get_lines()[0].remove(), "axes 0 are empty"),
    (lambda axes: axes.get_lines()[0].set_ydata([np.nan, np.nan]), "axes 0 are empty"),
    (lambda axes: axes.set_ylabel(""), "a scale of numbers in y has no name"),
    (lambda axes: axes.set_title("falls by nan N"), "'falls by nan N'"),
    (lambda axes: axes.remove(), "the figure has no axes")])
def test_the_check_of_figures_finds_what_is_wanting(spoil: Callable[[Any], Any], words: str | None,
                                                    find_wanting: Callable[[Figure], list[str]]) -> None:
    figure = plate("scene").figure
    for axes in figure.axes:
        spoil(axes)
    figure.draw_without_rendering()
    assert find_wanting(figure) == ([] if words is None else [words])


def test_figures_of_pages_are_checked(tmp_path: Path, drawn: list[Figure]) -> None:
    render(make_report(tmp_path, plate("scene")), tmp_path / "a.pdf")
    assert len(drawn) == 1
    spoilt = plate("scene")
    spoilt.figure.axes[0].set_xlabel("Time")
    with pytest.raises(AssertionError, match="scene: 'Time' has no unit"):
        render(make_report(tmp_path, spoilt), tmp_path / "a.pdf")


def test_a_legend_wider_than_its_sheet_is_found(find_wanting: Callable[[Figure], list[str]]) -> None:
    figure = plate("scene").figure
    figure.legend(["a method with a long name"], loc="outside lower center")
    figure.draw_without_rendering()
    assert not find_wanting(figure)
    figure.legend(["a method with a long name, and " * 12], loc="outside upper center")
    figure.draw_without_rendering()
    (found,) = find_wanting(figure)
    assert found.endswith("mm are cut off at an edge")


@pytest.mark.parametrize("finding", ["It falls by nan N.", "It falls by None.", "TODO"])
def test_the_check_of_pages_finds_what_is_wanting(tmp_path: Path, read_pdf: Reader, finding: str) -> None:
    render(make_report(tmp_path, findings=[finding]), tmp_path / "a.pdf")
    with pytest.raises(AssertionError):
        read_pdf(tmp_path / "a.pdf")
