"""From frames to images, in arrays and in files: VTU for ParaView, or a CSV of one row a pixel."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import ArrayLike

from eitsim.electrics.imaging.compared import DIFFERENCES, Compared, compared
from eitsim.electrics.imaging.gauss_newton import NOISE_FIGURE, Imager, Pixels, check_prior, imager, on_grid
from eitsim.electrics.imaging.greit_figures import Blob, blob, regions
from eitsim.scene.drive import protocol
from eitsim.scene.electrodes import unread
from eitsim.scene.frames import Frames, read_frames
from eitsim.scene.scene import Scene, as_scene
from touchcal.arrays import Array
from touchcal.csv_numbers import write_numbers

Reader = Callable[[Path, int], Frames]  # of a file and its readings a frame; empty ones are NaN

SUFFIXES = (".vtu", ".csv")
# An image is of no clear touch where it leaves more than this of the readings' change, or its other sign reaches more
# than this of its peak, or more than this of the disc has a quarter of it. Of two simulated touches with three times as
# much signal as noise the first two were at most 0.43 and 0.31, of five without noise the third at most 0.50; of noise
# alone the first was at least 0.8, and of untouched readings times a factor the third at least 0.85.
_UNEXPLAINED, _OTHER_SIGN, _FILLED = 0.75, 0.6, 0.6
# Readings' change over the untouched ones, 2-norms, that is taken for a slip: five simulated scenes made 0.009 at most.
_LARGEST_CHANGE = 0.3
_AS_USUAL = 1e-3  # relative distance from the usual noise figure at which one is another


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
    # frame's; None where images are of differences that say nothing of them
    conductance_S: float | None
    misfit: float | None
    # as given, and as reached
    prior: str
    noise_figure: float
    differences: str  # what the images are of: "volts", "normalised" or "given" differences
    cautions: tuple[str, ...]  # what to mind, a sentence or two each


def reconstruct(frames_V: ArrayLike, baseline_V: ArrayLike | None, *, scene: Scene | Path | str | None = None,
                prior: str = "laplace", noise_figure: float | None = None, kind: str = "voltage",
                differences: str = "auto") -> Images:
    """Images of the relative change of the skin's conductance: one regularised Gauss-Newton step from the untouched
    frame.

    Parameters
    ----------
    frames_V
        Touched frames, V, as (frames, readings) or, one or more, as (..., patterns, readings a pattern). Readings that
        are NaN in a frame, or 0 in all of them, were not measured: images do without them.
    baseline_V
        The untouched frame, V, or several, whose mean counts; None for readings that are differences.
    scene
        `Scene`, or scene file, whose body, electrodes and drive made the frames; by default the default ones.
    prior
        "laplace", or "noser", which rings less and places touches worse.
    noise_figure
        SNR of the readings over SNR of the image; smaller is smoother. None: 0.5, or the nearest that can be had.
    kind
        What the readings are: "voltage", "magnitude" (their sizes alone) or "difference" (touched less untouched).
    differences
        "volts"; "normalised", (v - v_0) / v_0 of each reading, in which a gain of each cancels; "auto": volts where a
        uniform skin explains the untouched frame, else normalised ones where images explain these.

    Returns
    -------
    Images
        `change` on `pixels`; `seen` holds of each image its largest value, place and separate regions.

    Raises
    ------
    ValueError
        Where the readings are not those of the scene's drive, nothing explains them, or the prior or the noise figure
        cannot be had.

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
    check_differences(differences)
    scene = as_scene(Scene() if scene is None else scene)
    frames = _frames(frames_V, scene, "frames_V")
    if baseline_V is None and kind != "difference":
        raise ValueError(f"baseline_V is None, and readings of the kind {kind!r} need an untouched frame; give one.")
    reference = None if baseline_V is None else _frames(baseline_V, scene, "baseline_V").mean(axis=0)
    taken = compared(frames, reference, scene, kind, differences)
    untouched = taken.untouched
    made = imager(untouched, prior=prior, noise_figure=noise_figure)
    images = made(taken.signal)
    seen_in = images @ untouched.jacobian_V.T
    left = [_unexplained(*one) for one in zip(taken.signal, seen_in, strict=True)]
    whole = _unexplained(taken.signal, seen_in)
    if taken.why and whole > _UNEXPLAINED:
        raise ValueError(f"{taken.why} Images of normalised differences leave {whole:.0%} of the frames' changes, so "
                         "that they mean nothing either. Are the readings in another order, magnitudes, or of another "
                         "sensor? `eitsim sensor inspect` says what they look like.")
    points, area, squares = on_grid(untouched.pixels, images)
    relative, rest = taken.differences != "given", taken.reference
    seen = tuple(_seen(points, area, square, relative, _unlike(rest + signal, rest), unexplained)
                 for square, signal, unexplained in zip(squares, taken.signal, left, strict=True))
    lost = int(np.isnan(untouched.readings_V).sum() - unread(scene.drive, scene.electrodes).sum()) - taken.vanishing
    return Images(untouched.pixels, images, seen, None if taken.misfit is None else untouched.conductance_S,
                  taken.misfit, prior, made.noise_figure, taken.differences,
                  tuple(_cautions(taken, lost, made, noise_figure)))


def check_differences(differences: str) -> None:
    """ValueError for differences that are none of DIFFERENCES."""
    if differences not in DIFFERENCES:
        raise ValueError(f"differences '{differences}' is unknown; known: {', '.join(DIFFERENCES)}.")


def _cautions(taken: Compared, lost: int, made: Imager, noise_figure: float | None) -> Iterator[str]:
    """What to mind of images, in words."""
    if lost:
        yield f"{lost} of {len(taken.reference)} readings are empty in a frame, or 0 in all: they were left out."
    if taken.vanishing:
        yield f"{taken.vanishing} readings are nearly 0 in the untouched frame: they were left out."
    if taken.why:
        yield f"{taken.why} Images are of normalised differences, in which a gain of each reading cancels."
    if taken.differences != "volts":
        yield "The images show where, not how much: their size is qualitative."
    if noise_figure is None and abs(made.noise_figure / NOISE_FIGURE - 1) > _AS_USUAL:
        yield (f"The usual noise figure of {NOISE_FIGURE:g} cannot be had with these readings: "
               f"{made.noise_figure:.2g} is taken, the nearest that can.")


def _frames(given: ArrayLike, scene: Scene, name: str) -> Array:
    """(frames, readings), V; ValueError for other last axes than readings, or patterns and readings, or an infinity."""
    shape = protocol(scene.drive, scene.electrodes.count).weights.shape[:2]
    count = shape[0] * shape[1]
    volts = np.asarray(given, dtype=float)
    if volts.size == 0 or (volts.shape[-1:] != (count,) and volts.shape[-2:] != shape):
        raise ValueError(f"{name} has the shape {volts.shape}, and electrodes and drive make frames of {count} "
                         "readings; check them, or give the scene that made the frames.")
    volts = volts.reshape(-1, count)
    if len(wrong := np.argwhere(np.isinf(volts))):
        raise ValueError(f"{name} is infinite at reading {wrong[0, 1]} of frame {wrong[0, 0]}; leave the frame out, or "
                         "make the reading NaN.")
    return volts


def images_of(frames: Path, scene: Scene, *, baseline: Path | None = None, prior: str = "laplace",
              noise_figure: float | None = None, kind: str = "voltage", differences: str = "auto",
              read: Reader = read_frames) -> tuple[Images, dict[str, Any]]:
    """Images of the frames in a file, and what they show as plain JSON values, with their lines.

    The untouched frame is the mean of those in `baseline`, else the first row of `frames`, or none where readings are
    differences. ValueError where there is no touched frame, and as `reconstruct`; InputFileError as `read`, which reads
    files as frames.read_frames does.
    """
    check_prior(prior, noise_figure)
    check_differences(differences)
    count = unread(scene.drive, scene.electrodes).size
    held, first = read(frames, count), 0 if baseline or kind == "difference" else 1
    if len(held.volts) == first:
        raise ValueError(f"{frames}: one frame only, and it is taken as the untouched one. Give --baseline FILE, or a "
                         "touched frame in a row below it.")
    reference = read(baseline, count).volts if baseline else held.volts[0] if first else None
    found = reconstruct(held.volts[first:], reference, scene=scene, prior=prior, noise_figure=noise_figure, kind=kind,
                        differences=differences)
    return found, {"conductance_S": found.conductance_S, "misfit": found.misfit, "prior": found.prior,
                   "noise_figure": found.noise_figure, "differences": found.differences,
                   "cautions": list(found.cautions),
                   "frames": [{"line": int(line), **_shown(one)}
                              for line, one in zip(held.line[first:], found.seen, strict=True)]}


def _unlike(frame: Array, reference: Array) -> str:
    """What no touch makes of the untouched readings, in words; empty where one may."""
    if not reference.any():
        return ""
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


def _seen(points: Array, area: Array, image: Array, relative: bool, unlike: str, unexplained: float) -> Seen:
    """What an image shows; relative: whether it is a relative change, which is not below -1."""
    if not image.any():
        return Seen(None, (), False, "this frame equals the untouched one: its image is 0 and has no centre.")
    found, parts = blob(points, area, image), tuple(regions(points, area, image))
    unclear = unlike or _unclear(image, found.peak, found.area_m2 / float(area.sum()), unexplained)
    notes = []
    if unclear:
        notes.append(f"no place is given: {unclear}")
    elif len(parts) > 1:
        places = " and ".join(f"({part.x_m * 1e3:.0f}, {part.y_m * 1e3:.0f})" for part in parts)
        notes.append(f"{len(parts)} separate regions at half of the largest value, at {places} mm; x_mm and y_mm are "
                     "of all together.")
    if relative and image.min() < -1:
        notes.append(f"the image reaches {image.min():.3g}, and no conductance falls by more than its whole, -1: one "
                     "linear step overshoots, and its size is no measure.")
    return Seen(found, parts, not unclear, " ".join(notes))


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
