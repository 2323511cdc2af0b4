"""From frames to images, in arrays and in files: VTU for ParaView, or a CSV of one row a pixel."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import ArrayLike, NDArray

from eitsim.electrics.imaging.gauss_newton import NOISE_FIGURE, Pixels, check_prior, fitted, imager, on_grid
from eitsim.electrics.imaging.greit_figures import Blob, blob, regions
from eitsim.scene.drive import protocol
from eitsim.scene.electrodes import unread
from eitsim.scene.frames import Frames, read_frames
from eitsim.scene.scene import Scene, as_scene
from touchcal.csv_numbers import write_numbers

Array = NDArray[np.float64]
Reader = Callable[[Path, int, NDArray[np.bool_]], Frames]  # of a file, its readings a frame and which may be empty

SUFFIXES = (".vtu", ".csv")
# An image is of no clear touch where it leaves more than this of the readings' change, or its other sign reaches more
# than this of its peak, or more than this of the disc has a quarter of it. Of two simulated touches with three times as
# much signal as noise the first two were at most 0.43 and 0.31, of five without noise the third at most 0.50; of noise
# alone the first was at least 0.8, and of untouched readings times a factor the third at least 0.85.
_UNEXPLAINED, _OTHER_SIGN, _FILLED = 0.75, 0.6, 0.6
# Part of the untouched frame that the best uniform skin may leave, 2-norms. The water tank of the Kuopio tomography
# challenge of 2023 leaves 0.18 uncalibrated; the default drive's readings in a random order leave 0.46.
_WORST_MISFIT = 0.3
# Readings' change over the untouched ones, 2-norms, that is taken for a slip: five simulated scenes made 0.009 at most.
_LARGEST_CHANGE = 0.3


@dataclass(frozen=True)
class Seen:
    """What one image shows."""

    blob: Blob | None  # its quarter-amplitude set, lengths in m; None where the image is 0
    regions: tuple[Blob, ...]  # separate regions at half of its largest value, the largest peak first
    clear: bool  # whether it shows a clear touch, so that the blob's centre is a place
    note: str  # in words, why there is no place, or that there are several regions; empty otherwise


@dataclass(frozen=True, eq=False)
class Images:
    """Difference images of some frames."""

    pixels: Pixels  # triangles of the images: corners, centroids (m) and areas (m^2)
    change: Array  # (frames, triangles) relative change of the sheet conductance
    seen: tuple[Seen, ...]  # one a frame
    # of the untouched skin that fits the untouched frame best: S a square, and 2-norm of what it misses over the
    # frame's
    conductance_S: float
    misfit: float
    # as given, and as reached
    prior: str
    noise_figure: float


def reconstruct(frames_V: ArrayLike, baseline_V: ArrayLike, *, scene: Scene | Path | str | None = None,
                prior: str = "laplace", noise_figure: float = NOISE_FIGURE) -> Images:
    """Images of the relative change of the skin's conductance: one regularised Gauss-Newton step from the untouched
    frame.

    Parameters
    ----------
    frames_V
        Touched frames, V, as (frames, readings) or, one or more, as (..., patterns, readings a pattern); readings that
        need a missing electrode may be NaN.
    baseline_V
        The untouched frame, V, or several, whose mean counts.
    scene
        `Scene`, or scene file, whose body, electrodes and drive made the frames; by default the default ones.
    prior
        "laplace", or "noser", which rings less and places touches worse.
    noise_figure
        SNR of the readings over SNR of the image; smaller is smoother.

    Returns
    -------
    Images
        `change` on `pixels`; `seen` holds of each image its largest value, place and separate regions.

    Raises
    ------
    ValueError
        Where the readings are not those of the scene's drive, no uniform skin fits the untouched frame, or the prior or
        the noise figure cannot be had.

    Examples
    --------
    >>> import eitsim
    >>> import matcal
    >>> foam = matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm")
    >>> card = matcal.MaterialCard("foam", foam, conductivity=matcal.Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
    >>> punch = eitsim.Punch(x_m=0.04, force_N=0.2)
    >>> touch = eitsim.simulate(eitsim.Scene(punches=[punch], accuracy=eitsim.Accuracy(0.05)), card)
    >>> images = eitsim.reconstruct(touch.readings.touched_V, touch.readings.baseline_V)
    >>> images.change.shape, images.seen[0].clear
    ((1, 864), True)
    """
    check_prior(prior, noise_figure)
    scene = as_scene(Scene() if scene is None else scene)
    lost = unread(scene.drive, scene.electrodes)
    shape = protocol(scene.drive, scene.electrodes.count).weights.shape[:2]
    frames = _frames(frames_V, lost, shape, "frames_V")
    reference = _frames(baseline_V, lost, shape, "baseline_V").mean(axis=0)
    untouched = fitted(scene.body, scene.electrodes, scene.drive, reference, scene.channels)
    misfit = np.linalg.norm(np.nan_to_num(untouched.readings_V - reference)) / np.linalg.norm(reference)
    if misfit > _WORST_MISFIT:
        raise ValueError(f"the untouched frame is no uniform skin's with these electrodes and this drive: {misfit:.2%} "
                         "of it stay unexplained, so that images would mean nothing. Are the readings in another "
                         "order, magnitudes, or of another sensor? `eitsim sensor inspect` says what they look like.")
    made = imager(untouched, prior=prior, noise_figure=noise_figure)
    images = made(frames - reference)
    points, area, squares = on_grid(untouched.pixels, images)
    seen = tuple(_seen(points, area, square, _unlike(frame, reference), _unexplained(frame - reference, explained))
                 for square, frame, explained in zip(squares, frames, images @ untouched.jacobian_V.T, strict=True))
    return Images(untouched.pixels, images, seen, untouched.conductance_S, float(misfit), prior, made.noise_figure)


def _frames(given: ArrayLike, lost: NDArray[np.bool_], shape: tuple[int, ...], name: str) -> Array:
    """(frames, readings), V, 0 where a reading needs a missing electrode; ValueError for other last axes than readings
    or `shape`, or a gap."""
    volts = np.asarray(given, dtype=float)
    if volts.size == 0 or (volts.shape[-1:] != (lost.size,) and volts.shape[-2:] != shape):
        raise ValueError(f"{name} has the shape {volts.shape}, and electrodes and drive make frames of {lost.size} "
                         "readings; check them, or give the scene that made the frames.")
    volts = np.where(lost, 0.0, volts.reshape(-1, lost.size))
    if len(gaps := np.argwhere(~np.isfinite(volts))):
        raise ValueError(f"{name} is not finite at reading {gaps[0, 1]} of frame {gaps[0, 0]}, and its electrodes are "
                         "all there; leave the frame out, or name what is missing in the scene's electrodes.")
    return volts


def images_of(frames: Path, scene: Scene, *, baseline: Path | None = None, prior: str = "laplace",
              noise_figure: float = NOISE_FIGURE, read: Reader = read_frames) -> tuple[Images, dict[str, Any]]:
    """Images of the frames in a file, and what they show as plain JSON values, with their lines.

    The untouched frame is the mean of those in `baseline`, else the first row of `frames`. ValueError where there is no
    touched frame, and as `reconstruct`; InputFileError as `read`, which reads files as frames.read_frames does.
    """
    check_prior(prior, noise_figure)
    lost = unread(scene.drive, scene.electrodes)
    held, first = read(frames, lost.size, lost), 0 if baseline else 1
    if len(held.volts) == first:
        raise ValueError(f"{frames}: one frame only, and it is taken as the untouched one. Give --baseline FILE, or a "
                         "touched frame in a row below it.")
    reference = read(baseline, lost.size, lost).volts if baseline else held.volts[0]
    found = reconstruct(held.volts[first:], reference, scene=scene, prior=prior, noise_figure=noise_figure)
    return found, {"conductance_S": found.conductance_S, "misfit": found.misfit, "prior": found.prior,
                   "noise_figure": found.noise_figure,
                   "frames": [{"line": int(line), **_shown(one)}
                              for line, one in zip(held.line[first:], found.seen, strict=True)]}


def _unlike(frame: Array, reference: Array) -> str:
    """What no touch makes of the untouched readings, in words; empty where one may."""
    times, change = float(frame @ reference / (reference @ reference)), frame - reference
    largest = float(np.linalg.norm(change) / np.linalg.norm(reference))
    if largest <= _LARGEST_CHANGE:
        return ""
    if times < 0:
        return f"the frame is {times:.3g} times the untouched one: its sign is flipped; give both frames the same."
    return (f"the frame differs from the untouched one by {largest:.3g} of it (it is {times:.3g} times as large), "
            "which no touch does; give both in volts, of the same current and order.")


def _unexplained(change: Array, seen: Array) -> float:
    """Part of a change of readings that its image does not make; 2-norms."""
    size = np.linalg.norm(change)
    return float(np.linalg.norm(change - seen) / size) if size > 0 else 0.0


def _seen(points: Array, area: Array, image: Array, unlike: str, unexplained: float) -> Seen:
    if not image.any():
        return Seen(None, (), False, "this frame equals the untouched one: its image is 0 and has no centre.")
    found, parts = blob(points, area, image), tuple(regions(points, area, image))
    if unclear := unlike or _unclear(image, found.peak, found.area_m2 / float(area.sum()), unexplained):
        return Seen(found, parts, False, f"no place is given: {unclear}")
    places = " and ".join(f"({part.x_m * 1e3:.0f}, {part.y_m * 1e3:.0f})" for part in parts)
    return Seen(found, parts, True, "" if len(parts) == 1 else (
        f"{len(parts)} separate regions at half of the largest value, at {places} mm; x_mm and y_mm are of all "
        "together."))


def _shown(seen: Seen) -> dict[str, Any]:
    """What one image shows as plain JSON values, units in the names of the keys."""
    area, peak = (seen.blob.area_m2 * 1e6, seen.blob.peak) if seen.blob else (0.0, 0.0)
    return {**_place(seen.blob if seen.clear else None), "area_mm2": area, "peak": peak,
            "regions": [_place(part) | {"area_mm2": part.area_m2 * 1e6} for part in seen.regions],
            **({"note": seen.note} if seen.note else {})}


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


def write_images(images: Images, path: Path) -> None:
    """Write relative changes of sheet conductance, named frame_000, frame_001, ...

    A CSV has the columns x_mm, y_mm of the centroid and area_mm2 before them. ValueError for another suffix.
    """
    pixels, change = images.pixels, images.change
    check_suffix(path)
    names = [f"frame_{i:03d}" for i in range(len(change))]
    if path.suffix == ".csv":
        place = np.column_stack([pixels.centre_m * 1e3, pixels.area_m2 * 1e6])
        write_numbers(path, ["x_mm", "y_mm", "area_mm2", *names], np.column_stack([place, change.T]))
        return
    points = np.column_stack([pixels.nodes_m, np.zeros(len(pixels.nodes_m))])
    meshio.Mesh(points, [("triangle", pixels.triangles)],
                cell_data={name: [image] for name, image in zip(names, change, strict=True)}).write(path)


def check_suffix(path: Path) -> None:
    """ValueError unless a file of images can have that name."""
    if path.suffix not in SUFFIXES:
        raise ValueError(f"--out {path}: images are written as {' or '.join(SUFFIXES)}; give a name that ends so.")
