"""A press in three dimensions: the half-cut foam as it is deformed, coloured by strain, with punch and electrodes."""

from __future__ import annotations

import ctypes
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reports.document.style import FAINT, GREY, SECOND, SEQUENTIAL, house
from touchcal.lazy import needed

if TYPE_CHECKING:
    from PIL.Image import Image

SUFFIXES = (".png", ".gif")
# Libraries that draw without a display on Linux, of which VTK takes the first that is there.
_OFF_SCREEN = ("libEGL.so.1", "libOSMesa.so.8", "libOSMesa.so.6")
# Parts of a step, and what each needs among its point fields, next to a driving strain of the foam.
FIELDS = {"foam": ["displacement_m"], "punch": ["displacement_m", "force_N"],
          "electrodes": ["displacement_m", "electrode"]}
PARTS = list(FIELDS)
# Words of a driving strain, by the name of its field in a series.
TITLES = {"driving_strain_principal": "largest strain in plane, %", "driving_strain_areal": "areal strain, %",
          "driving_strain_normal": "strain through the thickness, %"}
# Size of the picture, mm, and pixels an inch of it in print and in an animation.
WIDTH_MM, HEIGHT_MM = 120.0, 96.0
_PRINT_DPI, _SCREEN_DPI = 300, 110
_PUNCH, _ELECTRODE, _REMOVED = GREY, SECOND, FAINT
# Heights of the views of the whole skin and of the punch, and of the bar of colours, over that of the picture.
_WHOLE, _NEAR, _BAR = 0.37, 0.465, 0.025
# Widths of the views: of the disc, and in diameters of the punch; and where the camera stands, degrees above the skin.
_DISCS, _DIAMETERS, _ABOVE = 1.12, 3.6, 17.0
_NEARER = (-4.0, -2000.0)  # Factor and units of VTK's polygon offset that draws what touches the foam before it.
# Time between pictures of an animation and that of the last one, ms.
_EACH_MS, _LAST_MS = 110, 1500


@dataclass(frozen=True)
class Step:
    """One step of a series, its parts as pyvista's meshes of the untouched state."""

    foam: Any
    punch: Any
    electrodes: Any

    @property
    def force_N(self) -> float:
        """Force on the punch, N."""
        return float(self.punch["force_N"][0])

    @property
    def depth_m(self) -> float:
        """Depth of the punch's lowest point, m."""
        return -float(self.punch["displacement_m"][0, 2])

    @property
    def driving(self) -> str:
        """Name of the field of the strain that drives the skin."""
        return next(name for name in self.foam.point_data if name in TITLES)

    @property
    def axis_m(self) -> NDArray[np.float64]:
        """Where the punch's axis meets the untouched top (3,), m."""
        return (self.punch.points.min(axis=0) + self.punch.points.max(axis=0)) / 2 * np.array([1, 1, 0])

    @property
    def across(self) -> NDArray[np.float64]:
        """Unit vector (3,) from the foam out of its cut, the plane through the punch's axis and the disc's centre, or
        the nearest edge of an outline; the first points off the axis lie on it."""
        away = (self.foam.points - self.axis_m) * np.array([1, 1, 0])
        radius = np.linalg.norm(away, axis=1)
        first = int(np.argmax(radius > 1e-3 * radius.max()))
        return np.array([away[first, 1], -away[first, 0], 0.0]) / radius[first]

    @property
    def edges(self) -> Any:
        """The edges of an outline as lines; no cells on a disc."""
        return self.electrodes.extract_points(self.electrodes["electrode"] < 0, adjacent_cells=False)

    @property
    def middle_m(self) -> NDArray[np.float64]:
        """Middle of the skin (3,), m: of an outline that of the box about it."""
        points = self.edges.points
        return (points.min(axis=0) + points.max(axis=0)) / 2 if len(points) else np.zeros(3)

    @property
    def rim_m(self) -> float:
        """Largest distance of the edge from the middle, m; the radius of a disc."""
        return float(np.linalg.norm((self.electrodes.points - self.middle_m)[:, :2], axis=1).max())


def draw_press(series: Path | str, out: Path | str) -> Path:
    """Draw a press off-screen, half cut: its last step as a PNG, or all of them as an animated GIF.

    Parameters
    ----------
    series
        The .pvd that `eitsim run --fields press.pvd` or `eitsim.write_press` writes.
    out
        The picture, .png or .gif.

    Returns
    -------
    Path
        `out`.

    Raises
    ------
    ValueError
        Where the series is none, the suffix is another one, or pyvista or what it draws with is not installed.
    """
    series, out = Path(series), Path(out)
    check_picture(out)
    steps = read_steps(series)
    limits = strain_limits(steps)
    if out.suffix == ".png":
        _picture(steps[-1], limits, _PRINT_DPI).save(out, dpi=(_PRINT_DPI, _PRINT_DPI))
        return out
    pictures = [_picture(step, limits, _SCREEN_DPI) for step in steps]
    palette = pictures[-1].quantize(256)
    first, *others = (picture.quantize(palette=palette) for picture in pictures)
    first.save(out, save_all=True, append_images=others, duration=[_EACH_MS] * len(others) + [_LAST_MS], loop=0)
    return out


def check_picture(out: Path) -> None:
    """ValueError for a suffix that is none of SUFFIXES, and where pyvista or what it draws with is missing."""
    if out.suffix not in SUFFIXES:
        raise ValueError(f"`out` {out}: a picture is a .png, an animation a .gif; give a name that ends so.")
    needed("pyvista", "pictures in three dimensions")
    if not can_draw():
        raise ValueError(f"pictures in three dimensions are drawn without a display by {' or '.join(_OFF_SCREEN)}, "
                         "and none can be loaded. Install one; on Debian: apt-get install libegl1 libgl1-mesa-dri")


def can_draw() -> bool:
    """Whether there is a display, or on Linux a library that draws without one; VTK ends the process without either."""
    return bool(os.environ.get("DISPLAY")) or not sys.platform.startswith("linux") or any(map(_loads, _OFF_SCREEN))


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def read_steps(series: Path) -> list[Step]:
    """The steps of a series, in order; ValueError where the file is none, or one of its VTU files is damaged."""
    refusal = f"{series}: no series of a press; give the .pvd that eitsim run --fields press.pvd writes."
    try:
        listed = list(ElementTree.parse(series).iter("DataSet"))
    except (OSError, ElementTree.ParseError):
        raise ValueError(refusal) from None
    steps = []
    for first in range(0, len(listed), len(PARTS)):
        parts = listed[first:first + len(PARTS)]
        files = [series.parent / part.get("file", "") for part in parts]
        if [part.get("name") for part in parts] != PARTS or not all(file.is_file() for file in files):
            raise ValueError(f"{refusal} Its folder must lie next to it.")
        steps.append(Step(*map(_part, PARTS, files)))
    if not steps:
        raise ValueError(refusal)
    return steps


def _part(name: str, file: Path) -> Any:
    """The mesh of one part of a step; ValueError where its file is damaged or lacks a field."""
    import pyvista
    from vtkmodules.vtkCommonCore import vtkLogger
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # the error below is all that is said
    again = "Write the series again: eitsim run --fields press.pvd."
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(file))
    try:
        with pyvista.VtkErrorCatcher(raise_errors=True, send_to_logging=False):
            reader.Update()
    except RuntimeError:
        raise ValueError(f"{file}: the VTU file is damaged. {again}") from None
    mesh: Any = pyvista.wrap(reader.GetOutput())
    missing = [field for field in FIELDS[name] if field not in mesh.point_data]
    if name == "foam" and not any(field in TITLES for field in mesh.point_data):
        missing.append(f"a driving strain ({', '.join(TITLES)})")
    if missing:
        raise ValueError(f"{file}: the point field {missing[0]} is missing. {again}")
    return mesh


def strain_limits(steps: list[Step]) -> tuple[float, float]:
    """Least and largest strain of the skin over all steps, %; 0 lies between them."""
    found = [100 * step.foam[step.driving][step.foam.points[:, 2] == step.foam.points[:, 2].max()] for step in steps]
    return min(0.0, *(float(values.min()) for values in found)), max(0.0, *(float(values.max()) for values in found))


def colours(limits: tuple[float, float]) -> str:
    """The map of colours that is light at 0: of strains that are mostly positive, or negative."""
    return SEQUENTIAL if -limits[0] > limits[1] else f"{SEQUENTIAL}_r"


def _picture(step: Step, limits: tuple[float, float], dpi: int) -> Image:
    """Both views of a step over the bar of colours."""
    from PIL import Image

    with house():
        figure = Figure(figsize=(WIDTH_MM / 25.4, HEIGHT_MM / 25.4), dpi=dpi)
        canvas = FigureCanvasAgg(figure)
        for bottom, height, near in ((1 - _WHOLE, _WHOLE, False), (1 - _WHOLE - _NEAR, _NEAR, True)):
            axes = figure.add_axes((0, bottom, 1, height))
            axes.set_axis_off()
            size = round(WIDTH_MM / 25.4 * dpi), round(height * HEIGHT_MM / 25.4 * dpi)
            axes.imshow(view(step, limits, size, near=near), aspect="auto")
        bar = figure.add_axes((0.25, 1 - _WHOLE - _NEAR - 2 * _BAR, 0.5, _BAR))
        figure.colorbar(ScalarMappable(Normalize(*limits), colours(limits)), bar, orientation="horizontal",
                        label=TITLES[step.driving])
        figure.text(0.03, 0.06, f"{step.force_N:.2f} N\n{1e3 * step.depth_m:.2f} mm deep")
        canvas.draw()
        return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])


def view(step: Step, limits: tuple[float, float], size: tuple[int, int], *, near: bool) -> NDArray[np.uint8]:
    """Pixels (height, width, 3) of the whole skin, or of what is near the punch, seen across the cut."""
    import pyvista
    from vtkmodules.vtkCommonCore import vtkLogger

    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)  # no warning that there is no display
    plotter: Any = pyvista.Plotter(off_screen=True, window_size=list(size))
    plotter.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    there = step.electrodes.extract_points(step.electrodes["electrode"] >= 0, adjacent_cells=False)
    foam, punch, electrodes = (part.warp_by_vector("displacement_m").extract_surface(algorithm="dataset_surface")
                               for part in (step.foam, step.punch, there))
    edges: Any = step.edges
    whole = edges if edges.n_cells else pyvista.Circle(radius=step.rim_m, resolution=200).extract_feature_edges()
    plotter.add_mesh(whole, color=_REMOVED, line_width=size[0] / 400)
    plotter.add_mesh(foam, scalars=100 * foam[step.driving], clim=limits, cmap=colours(limits), show_scalar_bar=False,
                     smooth_shading=True, split_sharp_edges=True, feature_angle=60, ambient=0.2)
    touching = [plotter.add_mesh(punch.clip(step.across, origin=step.axis_m), color=_PUNCH, opacity=0.5,
                                 smooth_shading=True, split_sharp_edges=True, specular=0.4),
                plotter.add_mesh(electrodes, color=_ELECTRODE, line_width=size[0] / 120, render_lines_as_tubes=True)]
    for actor in touching:  # before the foam that they touch
        actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
        actor.mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(*_NEARER)
    _look(plotter.camera, step, size, near=near)
    plotter.renderer.ResetCameraClippingRange()
    pixels = plotter.screenshot(None, return_img=True)
    plotter.close()
    return pixels


def _look(camera: Any, step: Step, size: tuple[int, int], *, near: bool) -> None:
    """Turn a camera to the cut."""
    axis, across = step.axis_m, step.across
    towards = np.cos(np.radians(_ABOVE)) * across + np.array([0, 0, np.sin(np.radians(_ABOVE))])
    span = _DIAMETERS * np.ptp(step.punch.points[:, 0]) if near else _DISCS * 2 * step.rim_m
    camera.focal_point = axis if near else step.middle_m
    camera.position = camera.focal_point + 5 * span * towards
    camera.up = (0.0, 0.0, 1.0)
    camera.parallel_projection = True
    camera.parallel_scale = span / 2 * size[1] / size[0]
