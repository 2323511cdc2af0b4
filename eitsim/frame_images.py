"""From files of frames to files of images: VTU for ParaView, or a CSV of one row a pixel."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

from eitsim.electrodes import unread
from eitsim.figures_of_merit import blob
from eitsim.frames import read_frames
from eitsim.number_table import write_numbers
from eitsim.reconstruction import NOISE_FIGURE, Pixels, fitted, imager, on_grid
from eitsim.scene import Scene

Array = NDArray[np.float64]

SUFFIXES = (".vtu", ".csv")


def images_of(frames: Path, scene: Scene, *, baseline: Path | None = None, prior: str = "laplace",
              noise_figure: float = NOISE_FIGURE) -> tuple[Pixels, Array, dict[str, Any]]:
    """Pixels, images (frames, triangles) of the frames in a file, and what is told of them as plain JSON values.

    The untouched frame is the mean of those in `baseline`, else the first row of `frames`. Of each image: its line,
    largest value, and area and centre of the quarter-amplitude set (figures_of_merit.blob); of one of a frame that
    equals the untouched one no centre, and a note. ValueError where there is no touched frame, and as
    reconstruction.fitted and imager; TestFileError as frames.read_frames.
    """
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
        "frames": [_told(line, points, area, square) for line, square in zip(read.line[first:], squares, strict=True)]}


def _told(line: int, points: Array, area: Array, image: Array) -> dict[str, Any]:
    if not image.any():
        return {"line": int(line), "x_mm": None, "y_mm": None, "area_mm2": 0.0, "peak": 0.0,
                "note": "this frame equals the untouched one: its image is 0 and has no centre."}
    found = blob(points, area, image)
    return {"line": int(line), "x_mm": found.x_m * 1e3, "y_mm": found.y_m * 1e3, "area_mm2": found.area_m2 * 1e6,
            "peak": found.peak}


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
