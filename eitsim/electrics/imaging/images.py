"""From files of frames to files of images: VTU for ParaView, or a CSV of one row a pixel."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

from eitsim.electrics.imaging.gauss_newton import NOISE_FIGURE, Pixels, check_wanted, fitted, imager, on_grid
from eitsim.electrics.imaging.greit_figures import Blob, blob, regions
from eitsim.scene.electrodes import unread
from eitsim.scene.frames import read_frames
from eitsim.scene.scene import Scene
from touchcal.csv_numbers import write_numbers

Array = NDArray[np.float64]

SUFFIXES = (".vtu", ".csv")
# An image is of no clear touch where it leaves more than this of the readings' change, or its other sign reaches more
# than this of its peak, or more than this of the disc has a quarter of it. Of two simulated touches with three times as
# much signal as noise the first two were at most 0.43 and 0.31, of five without noise the third at most 0.50; of noise
# alone the first was at least 0.8, and of untouched readings times a factor the third at least 0.85.
_UNEXPLAINED, _OTHER_SIGN, _FILLED = 0.75, 0.6, 0.6
# Readings' change over the untouched ones, 2-norms, that is taken for a slip: five simulated scenes made 0.009 at most.
_LARGEST_CHANGE = 0.3


def images_of(frames: Path, scene: Scene, *, baseline: Path | None = None, prior: str = "laplace",
              noise_figure: float = NOISE_FIGURE) -> tuple[Pixels, Array, dict[str, Any]]:
    """Pixels, images (frames, triangles) of the frames in a file, and what is told of them as plain JSON values.

    The untouched frame is the mean of those in `baseline`, else the first row of `frames`. Of each image: its line,
    largest value, and area and centre of the quarter-amplitude set (figures_of_merit.blob), and its separate regions
    at half of that value (figures_of_merit.regions). Where there is no clear touch the centre is None, and a note says
    why; so does one for frames that no touch makes. ValueError where there is no touched frame, and as
    reconstruction.fitted and imager; TestFileError as frames.read_frames.
    """
    check_wanted(prior, noise_figure)
    lost = unread(scene.drive, scene.electrodes)
    read, first = read_frames(frames, lost.size, lost), 0 if baseline else 1
    if len(read.volts) == first:
        raise ValueError(f"{frames}: one frame only, and it is taken as the untouched one. Give --baseline FILE, or a "
                         "touched frame in a row below it.")
    reference = read_frames(baseline, lost.size, lost).volts.mean(axis=0) if baseline else read.volts[0]
    untouched = fitted(scene.body, scene.electrodes, scene.drive, reference)
    made = imager(untouched, prior=prior, noise_figure=noise_figure)
    images = made(read.volts[first:] - reference)
    misfit = np.linalg.norm(np.nan_to_num(untouched.readings_V - reference)) / np.linalg.norm(reference)
    points, area, squares = on_grid(untouched.pixels, images)
    return untouched.pixels, images, {
        "conductance_S": untouched.conductance_S, "misfit": float(misfit), "prior": prior,
        "noise_figure": made.noise_figure,
        "frames": [_told(line, points, area, square, _unlike(frame, reference), _unexplained(frame - reference, seen))
                   for line, square, frame, seen in zip(read.line[first:], squares, read.volts[first:],
                                                        images @ untouched.jacobian_V.T, strict=True)]}


def _unlike(frame: Array, reference: Array) -> str:
    """What no touch makes of the untouched readings, in words; empty where one may."""
    times, change = float(frame @ reference / (reference @ reference)), frame - reference
    largest = float(np.linalg.norm(change) / np.linalg.norm(reference))
    if largest <= _LARGEST_CHANGE:
        return ""
    if times < 0:
        return f"the frame is {times:.3g} times the untouched one: its sign is flipped; give both frames alike."
    return (f"the frame differs from the untouched one by {largest:.3g} of it (it is {times:.3g} times as large), "
            "which no touch does; give both in volts, of the same current and order.")


def _unexplained(change: Array, seen: Array) -> float:
    """Part of a change of readings that its image does not make; 2-norms."""
    size = np.linalg.norm(change)
    return float(np.linalg.norm(change - seen) / size) if size > 0 else 0.0


def _told(line: int, points: Array, area: Array, image: Array, unlike: str, unexplained: float) -> dict[str, Any]:
    if not image.any():
        return {"line": int(line), "x_mm": None, "y_mm": None, "area_mm2": 0.0, "peak": 0.0, "regions": [],
                "note": "this frame equals the untouched one: its image is 0 and has no centre."}
    found, parts = blob(points, area, image), regions(points, area, image)
    unclear = unlike or _unclear(image, found.peak, found.area_m2 / float(area.sum()), unexplained)
    told = {"line": int(line), **_place(None if unclear else found), "area_mm2": found.area_m2 * 1e6,
            "peak": found.peak, "regions": [_place(part) | {"area_mm2": part.area_m2 * 1e6} for part in parts]}
    if not unclear and len(parts) > 1:
        places = " and ".join(f"({part.x_m * 1e3:.0f}, {part.y_m * 1e3:.0f})" for part in parts)
        return told | {"note": f"{len(parts)} separate regions at half of the largest value, at {places} mm; x_mm and "
                               "y_mm are of all together."}
    return told | ({"note": f"no place is told: {unclear}"} if unclear else {})


def _place(found: Blob | None) -> dict[str, float | None]:
    return {"x_mm": None, "y_mm": None} if found is None else {"x_mm": found.x_m * 1e3, "y_mm": found.y_m * 1e3}


def _unclear(image: Array, peak: float, filled: float, unexplained: float) -> str:
    """Why an image shows no clear touch, in words; empty where it does."""
    other = float(np.max(-np.sign(peak) * image)) / abs(peak)
    if filled > _FILLED:
        return f"no clear touch, the image fills {filled:.0%} of the disc; all readings may have changed by a factor."
    if other > _OTHER_SIGN:
        return f"no clear touch, the image's other sign reaches {other:.0%} of its peak, as noise does."
    if unexplained > _UNEXPLAINED:
        return f"no clear touch, the image leaves {unexplained:.0%} of the readings' change unexplained, as noise does."
    return ""


def write_images(pixels: Pixels, images: Array, path: Path) -> None:
    """Write relative changes of sheet conductance (frames, triangles), named frame_000, frame_001, ...

    A CSV has the columns x_mm, y_mm of the centroid and area_mm2 before them. ValueError for another suffix.
    """
    check_suffix(path)
    names = [f"frame_{i:03d}" for i in range(len(images))]
    if path.suffix == ".csv":
        place = np.column_stack([pixels.centre_m * 1e3, pixels.area_m2 * 1e6])
        write_numbers(path, ["x_mm", "y_mm", "area_mm2", *names], np.column_stack([place, images.T]))
        return
    points = np.column_stack([pixels.nodes_m, np.zeros(len(pixels.nodes_m))])
    meshio.Mesh(points, [("triangle", pixels.triangles)],
                cell_data={name: [image] for name, image in zip(names, images, strict=True)}).write(path)


def check_suffix(path: Path) -> None:
    """ValueError unless a file of images can have that name."""
    if path.suffix not in SUFFIXES:
        raise ValueError(f"--out {path}: images are written as {' or '.join(SUFFIXES)}; give a name that ends so.")
