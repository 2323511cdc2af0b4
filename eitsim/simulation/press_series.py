"""A press as a series of VTU files, for ParaView and for pictures: the half-cut foam, the punch and the electrodes."""

import math
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import meshio
import numpy as np

from eitsim.electrics.forward.sheet_fields import contact_pressure, surface_displacement
from eitsim.mechanics.rim.displacement_field import Places, displacement, gradient, widening
from eitsim.mechanics.rim.half_disc_fields import INWARDS, Lattice, lattice_of, turn
from eitsim.scene.edges.outline_electrodes import middles_m, patch_loops, stretches_along
from eitsim.scene.electrodes import arcs, lengths
from eitsim.scene.nearest_edge import nearest_edge
from eitsim.scene.outline_edge import edge_starts, places_along
from eitsim.scene.polygons import corners_and_edges
from eitsim.scene.results import Array, Touch, Volume
from eitsim.scene.scene import Body, Punch, Scene, as_scene, profile_of
from eitsim.sheet.sheet_conductance import driving_strain, surface_metric
from eitsim.simulation.choose import choose
from eitsim.simulation.material import material_of
from eitsim.simulation.words import refusal
from matcal.card import MaterialCard, as_card
from touchcal.whole_file import written

# Name of the point field that drives the skin, before the name of the strain as in [skin].
DRIVING = "driving_strain_"
STEPS = 20
# Names of a series' VTU files.
_NAMES = r"(foam|punch|electrodes)_\d{3,}\.vtu"
# Points of the punch's outline from its axis, and around it; height of the punch that is drawn, thicknesses.
_OUTLINE, _AROUND, _HEIGHT = 40, 72, 1.5
# Points along an electrode, and halvings that find the punch's face.
_ALONG, _HALVINGS = 9, 60


@dataclass(frozen=True)
class Block:
    """One part of a step: a mesh of the untouched state, with displacement_m among its point fields."""

    name: str
    points_m: Array  # (n, 3) m; z upwards from the untouched top
    cells: list[Any]  # names of cells in VTK, each with its nodes
    fields: Mapping[str, Any]


def check_press(scene: Scene, steps: int = STEPS) -> None:
    """ValueError, before anything is solved, where a scene has no such series."""
    if scene.hold.time_s or len(scene.punches) != 1:
        raise ValueError("a series of a press (.pvd) is built for one touch, without a hold; give one [punch], and "
                         "leave out time_s in [hold].")
    if steps < 1:
        raise ValueError(f"--fields-steps must be 1 or more, got {steps}.")


def check_folder(path: Path) -> Path:
    """The folder of a series' VTU files; ValueError where it would replace anything that no earlier series wrote."""
    folder = path.with_suffix("")
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise ValueError(f"{path}: the VTU files go to the folder {folder}, and a file or a link has that name. Choose "
                         "another name.")
    if folder.is_dir() and (strange := sorted(place.name for place in folder.iterdir()
                                              if not re.fullmatch(_NAMES, place.name))):
        raise ValueError(f"{path}: the VTU files would replace the folder {folder}, which holds {strange[0]}, no part "
                         "of a series. Choose another name.")
    return folder


def press_of(scene: Scene | Path | str, card: MaterialCard | Path | str, last: Touch | None = None, *,
             steps: int = STEPS, exact: bool = False,
             progress: Callable[[int], None] = lambda done: None) -> tuple[Touch, ...]:
    """Touches (steps,) of a scene's punch at equal steps of its force, or of its depth where that is given.

    Parameters
    ----------
    scene, card
        One touch, without a hold, and its material, as in `simulate`.
    last
        The scene's own touch where it is solved already.
    steps
        Number of touches; the untouched foam does not count.
    exact
        As in `simulate`.
    progress
        Called with the number of touches solved.

    Returns
    -------
    tuple of Touch
        As in a `Result`, each solved as the scene asks for; the last one has the scene's own load.

    Raises
    ------
    ValueError
        Where the scene has no such series, or cannot be solved.
    NotConverged
        Where a touch does not converge.

    Examples
    --------
    >>> import eitsim
    >>> import matcal
    >>> card = matcal.MaterialCard("foam", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"))
    >>> scene = eitsim.Scene(punches=[eitsim.Punch(force_N=0.2)], accuracy=eitsim.Accuracy(0.05))
    >>> half, whole = eitsim.press_of(scene, card, steps=2)
    >>> half.depth_m < whole.depth_m
    True
    """
    scene = as_scene(scene)
    check_press(scene, steps)
    material, (punch,) = material_of(scene, as_card(card)), scene.punches
    touches = []
    for k in range(1, steps + 1):
        if k == steps and last is not None:
            touches.append(last)
        else:
            part = replace(scene, punches=(loaded(punch, k / steps),))
            chosen = choose(part, material, exact=exact, bodies=False)
            if chosen.why is not None:
                raise ValueError(refusal(chosen.why))
            touches += chosen.touches()
        progress(k)
    return tuple(touches)


def loaded(punch: Punch, share: float) -> Punch:
    """The punch with that share of its force, or of its depth where that is given."""
    return replace(punch, **{name: share * value for name in ("force_N", "depth_m")
                             if (value := getattr(punch, name)) is not None})


def write_press(scene: Scene, touches: Sequence[Touch], path: Path | str) -> None:
    """Write touches at equal steps of a load, after the untouched foam, as VTU files and the .pvd that lists them; an
    earlier series of the name stays whole until this one is ready.

    Parameters
    ----------
    scene
        Where the touches were solved: body, punch, electrodes and the strain that drives the skin.
    touches
        As `press_of` gives them, with their displacements inside the foam.
    path
        The .pvd; the VTU files lie in a folder of its name next to it. Times in it are forces, N, or depths, mm, where
        the scene gives the depth. Parts 0, 1 and 2 are the foam, on the half of the disc counter-clockwise of the line
        from its centre through the punch, or of an outline of the line from the punch towards the nearest edge, as far
        as it is seen from there; the punch; and the electrodes, with the edges of an outline as number -1. "Warp By
        Vector" with displacement_m shows all three as they are pressed. The foam's driving_strain_<name> is the skin's
        own at the top, and inside the same measure of horizontal surfaces; contact_pressure_Pa is that of the touch
        without the rim, 0 below the top.

    Raises
    ------
    ValueError
        Where a touch keeps no displacements inside the foam, or the folder is a file or holds other files.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import eitsim
    >>> import matcal
    >>> card = matcal.MaterialCard("foam", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"))
    >>> scene = eitsim.Scene(punches=[eitsim.Punch(force_N=0.2)], accuracy=eitsim.Accuracy(0.05))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     eitsim.write_press(scene, eitsim.press_of(scene, card, steps=1), folder + "/press.pvd")
    ...     sorted(path.name for path in pathlib.Path(folder, "press").glob("foam*"))
    ['foam_000.vtu', 'foam_001.vtu']
    """
    path, (punch,) = Path(path), scene.punches
    volumes = [volume_of(scene.body, punch, touch) for touch in touches]
    folder = check_folder(path)
    listed = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    collection = ElementTree.SubElement(listed, "Collection")
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{folder.name}.", suffix=".part") as place:
        fresh = Path(place) / folder.name
        fresh.mkdir()
        blocks: tuple[Block, ...] = ()
        for k in range(len(touches) + 1):
            step = loaded(punch, k / len(touches))
            time = 1e3 * step.depth_m if step.depth_m is not None else step.force_N
            if k != 1:  # the untouched foam is that of the first touch, with fields of 0
                blocks = _blocks(scene, punch, touches[max(k - 1, 0)], volumes[max(k - 1, 0)])
            for part, block in enumerate(blocks):
                name = f"{block.name}_{k:03d}.vtu"
                mesh = meshio.Mesh(block.points_m, block.cells, point_data=_fields(block, pressed=k > 0))
                mesh.write(fresh / name, file_format="vtu")
                ElementTree.SubElement(collection, "DataSet", timestep=f"{time:.9g}", group="", part=str(part),
                                       name=block.name, file=f"{folder.name}/{name}")
        path.unlink(missing_ok=True)
        if folder.exists():
            folder.rename(Path(place) / "earlier")
        fresh.rename(folder)
    ElementTree.indent(listed)
    with written(path) as file:
        ElementTree.ElementTree(listed).write(file, encoding="utf-8", xml_declaration=True)


def volume_of(body: Body, punch: Punch, touch: Touch) -> Volume:
    """The displacement inside the foam of a touch: with the rim's effect, or an axisymmetric one as its harmonic 0."""
    if touch.volume is not None:
        return touch.volume
    if touch.section is None or touch.rim is not None:
        raise ValueError("this touch keeps no displacements inside the layer: it comes from a table, or lies near an "
                         "edge where they are not built. Solve it without one.")
    section, place = touch.section, np.array([punch.x_m, punch.y_m])
    edges = np.stack(corners_and_edges(body.outline), axis=1) - place if body.has_outline else None
    rows = int(np.argmax(np.diff(section.nodes_m[:, 1]) < 0)) + 1  # nodes go column by column, upwards
    radius, height = section.nodes_m[::rows, 0], section.nodes_m[:rows, 1]
    moved = np.zeros((len(radius), rows, 3, 1))
    moved[..., [0, 2], 0] = section.displacement_m.reshape(-1, rows, 2)
    none = np.zeros(2)
    order = math.isqrt(section.elements.shape[1]) - 1
    return Volume(radius, height - height[-1], order, moved, none, none, np.zeros((2, 2)), body.edge.size_m,
                  math.hypot(punch.x_m, punch.y_m), punch.diameter_m / 2, math.atan2(punch.y_m, punch.x_m), section.law,
                  place, edges)


def _blocks(scene: Scene, punch: Punch, touch: Touch, volume: Volume) -> tuple[Block, ...]:
    """Foam, punch and electrodes."""
    return (_foam(scene, punch, touch, volume), _punch(scene.body, punch, touch), _electrodes(scene, punch, touch))


def _fields(block: Block, *, pressed: bool) -> dict[str, Any]:
    """A block's fields as they are written; all are 0 where the foam is not pressed yet."""
    return {name: (field if pressed or name == "electrode" else 0 * field).astype(np.float32)
            for name, field in block.fields.items()}


def _foam(scene: Scene, punch: Punch, touch: Touch, volume: Volume) -> Block:
    """The half of the skin on shared points: displacements, the strain that drives the skin, and contact pressure."""
    lattice = lattice_of(volume, 1, _cut_rad(scene.body, punch))
    at, shape = _corners(lattice)
    axes = turn(volume, at)
    local = np.column_stack([at.radius_m, np.zeros_like(at.radius_m), at.height_m])
    points = (axes @ local[..., None])[..., 0] + np.array([punch.x_m, punch.y_m, 0.0])
    top = at.height_m == lattice.height_m[-1]
    strain = _strain(scene.skin.strain, gradient(volume, at))
    strain[top] = _skin_strain(scene.skin.strain, points[top, :2], punch, touch)
    pressure = np.zeros(len(points))
    pressure[top] = contact_pressure(points[top, :2], ((punch, touch),))
    moved = (axes @ displacement(volume, at)[..., None])[..., 0]
    return Block("foam", points, _cells(shape), {
        "displacement_m": moved, DRIVING + scene.skin.strain: strain, "contact_pressure_Pa": pressure})


def _cut_rad(body: Body, punch: Punch) -> float | None:
    """Direction to the nearest edge of an outline, rad; None on a disc."""
    if not body.has_outline:
        return None
    towards = nearest_edge(body.outline, (punch.x_m, punch.y_m)).towards
    return math.atan2(towards[1], towards[0])


def _corners(lattice: Lattice) -> tuple[Places, tuple[int, int, int]]:
    """All corners of a lattice, by radius, angle and height, each of the element inwards of and below it."""
    shape = (*lattice.radius_m.shape, len(lattice.height_m))
    i, j, k = np.indices(shape).reshape(3, -1)
    corner = np.column_stack([lattice.radius_m[i, j], lattice.height_m[k]])
    before = np.column_stack([lattice.radius_m[np.where(i > 0, i - 1, 1), j],
                              lattice.height_m[np.where(k > 0, k - 1, 1)]])
    return Places(corner[:, 0], corner[:, 1], j, lattice.angle_rad, corner + INWARDS * (before - corner)), shape


def _cells(shape: tuple[int, int, int]) -> list[tuple[str, Any]]:
    """Wedges on the axis and hexahedra outside it, nodes in VTK's order."""
    number = np.arange(math.prod(shape)).reshape(shape)

    def at(radius: int, angle: int, height: int, first: int) -> Any:
        radii, angles, heights = shape
        return number[first + radius:radii - 1 + radius, angle:angles - 1 + angle,
                      height:heights - 1 + height].ravel()

    ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
    hexahedra = np.column_stack([at(*place, k, 1) for k in (0, 1) for place in ring])
    wedges = np.column_stack([number[i, j:shape[1] - 1 + j, k:shape[2] - 1 + k].ravel()
                              for k in (0, 1) for i, j in [(0, 0), (1, 1), (1, 0)]])
    return [("wedge", wedges), ("hexahedron", hexahedra)]


def _strain(name: str, deformation: Array) -> Array:
    """The strain that would drive horizontal surfaces (n,) of deformation gradients (n, 3, 3)."""
    stretch = np.sqrt(np.linalg.eigvalsh((np.swapaxes(deformation, 1, 2) @ deformation)[:, :2, :2]))
    return driving_strain(name, stretch[:, 1], stretch[:, 0], np.linalg.det(deformation) / widening(deformation))


def _skin_strain(name: str, points_m: Array, punch: Punch, touch: Touch) -> Array:
    metric, normal = surface_metric(points_m, punch, touch)
    stretch = np.sqrt(np.linalg.eigvalsh(metric))
    return driving_strain(name, stretch[:, 1], stretch[:, 0], normal)


def _punch(body: Body, punch: Punch, touch: Touch) -> Block:
    """The punch's face and shank, of revolution, with its lowest point on the untouched top."""
    profile = profile_of(punch)
    radius = profile.radius * np.sin(np.linspace(0, np.pi / 2, _OUTLINE))
    low, high = np.zeros(_OUTLINE), np.full(_OUTLINE, _HEIGHT * body.thickness_m)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        inside = profile.signed_distance(radius * (1 - 1e-9), middle).penetration > 0
        low, high = np.where(inside, low, middle), np.where(inside, middle, high)
    radius, height = np.append(radius, radius[-1]), np.append(high, _HEIGHT * body.thickness_m)
    angle = math.atan2(punch.y_m, punch.x_m) + np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)
    points = np.stack([punch.x_m + np.outer(radius, np.cos(angle)), punch.y_m + np.outer(radius, np.sin(angle)),
                       np.repeat(height[:, None], _AROUND, axis=1)], axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape(-1, _AROUND)
    after = np.roll(number, -1, axis=1)
    quads = np.stack([number[:-1], after[:-1], after[1:], number[1:]], axis=-1).reshape(-1, 4)
    lid = np.column_stack([np.repeat(number[-1, 0], _AROUND), number[-1], after[-1]])
    return Block("punch", points, [("quad", quads), ("triangle", lid[1:-1])],
                 {"displacement_m": np.tile([0.0, 0.0, -touch.depth_m], (len(points), 1)),
                  "force_N": np.full(len(points), touch.force_N)})


def _electrodes(scene: Scene, punch: Punch, touch: Touch) -> Block:
    """Electrodes on the top, along the edge or on the surface; `electrode` is their number, -1 that of the edges of an
    outline."""
    parts = list(_on_outline(scene) if scene.body.has_outline else _on_disc(scene))
    first = np.cumsum([0, *(len(points) for _, points, _ in parts)])
    plane = np.concatenate([points for _, points, _ in parts])
    cells = [(kind, np.concatenate([numbers + start for (own, _, numbers), start in zip(parts, first, strict=False)
                                    if own == kind])) for kind in dict.fromkeys(kind for kind, _, _ in parts)]
    number = np.repeat(np.arange(len(parts), dtype=float), np.diff(first))
    number[number >= scene.electrodes.count] = -1
    return Block("electrodes", np.column_stack([plane, np.zeros(len(plane))]), cells,
                 {"displacement_m": surface_displacement(plane, ((punch, touch),)), "electrode": number})


def _on_disc(scene: Scene) -> Iterator[tuple[str, Array, Any]]:
    """Name of the cells, points (n, 2), m, and cells of each electrode at the rim: lines along it, or sectors."""
    patches = scene.electrodes.at_rim
    ends, length = arcs(scene.body.radius_m, scene.electrodes), lengths(scene.electrodes) * patches
    for (start, end), deep in zip(ends, length, strict=True):
        angle = np.linspace(start, end, _ALONG)
        radius = scene.body.radius_m - np.linspace(0, deep, _ALONG if patches else 1)
        plane = radius[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        number = np.arange(radius.size * _ALONG).reshape(-1, _ALONG)
        first, second = number[:, :-1], number[:, 1:]
        corners = [first[:-1], second[:-1], second[1:], first[1:]] if patches else [first, second]
        yield ("quad" if patches else "line", plane.reshape(-1, 2),
               np.stack(corners, axis=-1).reshape(-1, len(corners)))


def _on_outline(scene: Scene) -> Iterator[tuple[str, Array, Any]]:
    """As `_on_disc`: lines along the outer edge, or patches on the surface, then all edges."""
    shape = scene.body.outline
    if scene.electrodes.along_edge:
        starts = edge_starts(shape)
        corners = np.concatenate([starts[:-1] + turn * starts[-1] for turn in (-1, 0, 1, 2)])
        for start, end in stretches_along(shape, scene.electrodes):
            arc = np.unique(np.append(np.linspace(start, end, _ALONG), corners[(corners > start) & (corners < end)]))
            yield "line", places_along(shape, arc), _chain(len(arc))[:-1]
    else:
        for place, loop in zip(middles_m(shape, scene.electrodes), patch_loops(scene.electrodes), strict=True):
            fan = np.column_stack([_chain(len(loop)), np.full(len(loop), len(loop))])
            yield "triangle", np.vstack([loop, place]), fan
    for loop in shape.loops:
        yield "line", loop, _chain(len(loop))


def _chain(count: int) -> Any:
    """Numbers of points and of those after them (count, 2), around."""
    return np.column_stack([np.arange(count), (np.arange(count) + 1) % count])
