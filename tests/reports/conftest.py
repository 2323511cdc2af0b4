"""Small synthetic results and data sets, made by formula in the layout that the simulation writes."""

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.text import Text as Words
from pypdf import PdfReader

from eitsim.scene.drive import voltage_columns
from eitsim.scene.scene import scene_from, scene_tables
from eitsim.sweeps.dataset import parquet
from reports.document import style

CARD = {"name": "Synthetic foam", "file": "card.json", "sha256": "ab" * 32}


def voltages(x_mm: float, y_mm: float, strength: float) -> tuple[np.ndarray, np.ndarray]:
    """(16, 13) baseline and signal, V, of a small spot on a disc with point electrodes (a formula, not a solution)."""
    angle = 2 * np.pi * np.arange(16) / 16
    place = 100 * np.column_stack([np.cos(angle), np.sin(angle)])
    pattern, offset = np.meshgrid(np.arange(16), np.arange(2, 15), indexing="ij")
    source, sink, ground, read = pattern, (pattern + 1) % 16, (pattern - 1) % 16, (pattern + offset) % 16

    def distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.linalg.norm(place[a] - place[b], axis=-1)

    baseline = np.log(distance(read, sink) / distance(read, source) * distance(ground, source) / distance(ground, sink))
    field = (place - [x_mm, y_mm]) / np.sum((place - [x_mm, y_mm]) ** 2, axis=1, keepdims=True)
    signal = np.sum((field[source] - field[sink]) * (field[read] - field[ground]), axis=-1)
    return 2.5 * baseline, strength * signal


def make_result(**changes: Any) -> dict[str, Any]:
    """A result of one touch with the keys of `eitsim run`."""
    scene = scene_from({"punch": {"x_mm": 20, "y_mm": -10, "diameter_mm": 14, "force_N": 1.0}})
    baseline, signal = voltages(20, -10, 5.0)
    r = np.linspace(0, 100, 150)
    inside = r < 7
    pressure = np.where(inside, 5 + 13 * (r / 7) ** 8, 0.0)
    block = {"radius_mm": r, "u_r_mm": -0.06 * r * np.exp(-((r - 7) / 7) ** 2),
             "u_z_mm": -3.646 * np.where(inside, 1.0, np.exp((7 - r) / 6)), "pressure_kPa": pressure,
             "stretch_normal": 1 - pressure / 60, "stretch_meridian": 1 + 0.3 * np.exp(-((r - 7) / 2) ** 2),
             "stretch_hoop": 1 - 0.05 * np.exp(-((r / 10) ** 2))}
    plan = [{"decision": "mechanics axisymmetric about the punch", "reason": "its edge is 70.6 mm from the rim",
             "error_bound": 3e-7},
            {"decision": "no conduction through the punch", "reason": "conductor = false", "error_bound": 0.0},
            {"decision": "the skin is a sheet", "reason": "20 um on 10 mm", "error_bound": 0.002}]
    return {"schema": 1, "scene": scene_tables(scene), "card": CARD, "versions": {"touchcal": "0.1.0"},
            "outcome": "ok", "message": "", "plan": plan, "cost": {"cpu_s": 1.234, "wall_s": 1.5, "peak_MB": 312.3},
            "force_N": 1.0, "delta_max_mm": 3.646, "sigma_max_kPa": 18.87, "sigma_ave_kPa": 6.518, "A_c_mm2": 153.42,
            "wall_contact_mm2": 3.127, "readings_V": (baseline + signal).tolist(), "baseline_V": baseline.tolist(),
            "error_estimate": {"signal": 0.0045, "depth": 0.0012},
            "stability": {"elliptic": True, "fraction_non_elliptic": 0.0, "skin_fraction_extrapolated": 0.0127},
            "profile": [{name: values.tolist() for name, values in block.items()}]} | changes


@pytest.fixture
def write_result(tmp_path: Path) -> Callable[..., Path]:
    """Writes a synthetic result, keys changed as given or left out where None."""

    def write(**changes: Any) -> Path:
        path = tmp_path / "result.json"
        result = {key: value for key, value in make_result(**changes).items() if value is not None}
        path.write_text(json.dumps(result))
        return path

    return write


def make_rows(count: int, refused: int) -> list[dict[str, Any]]:
    """Rows of a data set; the last `refused` of them without numbers."""
    rng = np.random.default_rng(3)
    rows = []
    for i in range(count):
        x, y, force = rng.uniform(-50, 50), rng.uniform(-50, 50), rng.uniform(0.2, 1.5)
        row: dict[str, Any] = {"scene": i, "card_sample": -1, "outcome": "ok", "message": "", "x_mm": x, "y_mm": y,
                               "d_mm": 14.0, "F_N": force}
        numbers = {"sigma_max_kPa": 20 * force, "sigma_ave_kPa": force / 0.154, "A_c_mm2": 154.0 - 3 * rng.random(),
                   "delta_max_mm": 3.6 * force, "signal_error": 0.003 * force, "cpu_s": 0.7 + 0.3 * rng.random(),
                   "signal_share_extrapolated": 0.8 + 0.1 * force}
        if i >= count - refused:
            row |= {"outcome": "refused", "message": "too near the rim"} | dict.fromkeys(numbers, np.nan)
        else:
            baseline, signal = voltages(x, y, 5 * force)
            row |= numbers | dict(zip(voltage_columns(208), (baseline + signal).ravel(), strict=True))
            row |= dict(zip(voltage_columns(208, "dv"), signal.ravel(), strict=True))
        rows.append(row)
    return rows


@pytest.fixture
def write_set(tmp_path: Path) -> Callable[..., Path]:
    """Writes a synthetic data set in two parts."""

    def write(count: int = 20, refused: int = 0, scenes: int | None = None) -> Path:
        folder, rows = tmp_path / "set", make_rows(count, refused)
        folder.mkdir()
        tables = {"punch": {"x_mm": [-50, 50], "y_mm": [-50, 50], "diameter_mm": 14, "force_N": [0.2, 1.5]}}
        design = {"scenes": scenes or count, "seed": 7, "sampler": "random", "tables": tables}
        parquet.write_manifest(folder, {"design": design, "card": CARD, "versions": {"touchcal": "0.1.0"}})
        for part in (rows[: count // 2], rows[count // 2:]):
            parquet.write_part(folder, part)
        return folder

    return write


@dataclass(frozen=True)
class Text:
    """The words of a PDF."""

    pages: tuple[str, ...]

    @property
    def whole(self) -> str:
        """All pages, white space made single."""
        return " ".join(" ".join(self.pages).split())


@pytest.fixture
def read_pdf() -> Callable[[Path], Text]:
    """Extracts the text of a PDF and checks what must hold of every report."""

    def read(path: Path) -> Text:
        pages = PdfReader(path).pages
        text = Text(tuple(page.extract_text() for page in pages))
        words = set(re.findall(r"[A-Za-z]+", text.whole))
        assert len(words) > 10
        assert not words & {"nan", "NaN", "None", "inf", "TODO", "null", "placeholder"}
        return text

    return read


def wanting(figure: Figure) -> list[str]:
    """What must hold of every figure and does not: something is drawn, numbers are finite, axes have units."""
    shown = [axes for axes in figure.axes if axes.get_visible() and (axes.axison or _drawn(axes))]
    found = [] if shown else ["the figure has no axes"]
    found += [f"axes {i} are empty" for i, axes in enumerate(shown) if not _drawn(axes)]
    for axis, side in [(getattr(axes, f"{x}axis"), _beside(axes, shown, x)) for axes in shown if axes.axison
                       for x in "xy"]:
        words = axis.get_label_text()
        if words and not words.rstrip().endswith(")"):
            found.append(f"'{words}' has no unit")
        elif not words and _numbered(axis) and not any(getattr(other, f"{axis.axis_name}axis").get_label_text()
                                                       for other in side):
            found.append(f"a scale of numbers in {axis.axis_name} has no name")
    told = [words.get_text() for words in figure.findobj(Words) if isinstance(words, Words)]
    if cut := _cut_mm(figure):
        found.append(f"{cut:.1f} mm are cut off at an edge")
    return found + [f"'{words}'" for words in told if re.search(r"\b(nan|None|inf|TODO)\b", words)]


def _cut_mm(figure: Figure) -> float:
    """How far what is drawn reaches beyond the sheet, mm; 0 where by less than half a letter."""
    figure.set_dpi(400)  # letters on a coarse grid are wider than on the page
    inner, outer = figure.get_tightbbox(), figure.bbox_inches
    beyond = 25.4 * max(outer.x0 - inner.x0, outer.y0 - inner.y0, inner.x1 - outer.x1, inner.y1 - outer.y1)
    return beyond if beyond > 0.7 else 0.0


def _drawn(axes: Axes) -> bool:
    """Whether axes hold a finite point, a patch, an image or words."""
    points = [np.ma.filled(np.ma.asarray(line.get_xydata(), dtype=float), np.nan) for line in axes.get_lines()]
    parts = [*axes.collections, *axes.patches, *axes.images, *axes.texts]
    return bool(parts) or any(np.isfinite(one).all(axis=-1).any() for one in points)


def _numbered(axis: Axis) -> bool:
    words = [tick.label1.get_text() for tick in axis.get_major_ticks() if tick.label1.get_visible()]
    return axis.get_visible() and any(re.fullmatch(r"[−-]?[\d.]+|\$.*\d.*\$", one) for one in words if one)


def _beside(axes: Axes, others: list[Axes], x: str) -> list[Axes]:
    """Axes in the same column (x) or row (y), whose name may serve these too."""
    low, high = ((box := axes.get_position()).x0, box.x1) if x == "x" else ((box := axes.get_position()).y0, box.y1)
    return [one for one in others if one is not axes and min(high, _end(one, x, 1)) - max(low, _end(one, x, 0)) > 0]


def _end(axes: Axes, x: str, side: int) -> float:
    return getattr(axes.get_position(), f"{x}{side}")


@pytest.fixture
def find_wanting() -> Callable[[Figure], list[str]]:
    """The check of every figure."""
    return wanting


@pytest.fixture
def svg_too() -> None:
    """For a test of what lies next to a page: figures are written as SVG too."""


@pytest.fixture(autouse=True)
def drawn(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures that a test puts on pages, each checked when it is saved; the same figure again as SVG, which takes
    as long as the page, is an empty file unless a test asks for `svg_too`."""
    saved, save = list[Figure](), style.save

    def checked(figure: Figure, pdf: Path, svg: Path) -> None:
        save(figure, pdf, svg)
        assert not (found := wanting(figure)), f"{svg.stem}: {'; '.join(found)}"
        saved.append(figure)

    monkeypatch.setattr(style, "save", checked)
    if "svg_too" not in request.fixturenames:
        monkeypatch.setattr(style, "save_svg", lambda figure, svg: svg.touch())
    return saved
