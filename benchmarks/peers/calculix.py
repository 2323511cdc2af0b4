"""CalculiX's input of the axisymmetric touch with a filleted flat punch, a run of it, and what it printed.

Lengths in mm, stresses in kPa, forces in mN. The punch is a cup of prescribed nodes, so rigid; it is moved down, in
steps of a hundredth of the target depth near it, and the depth at a force is read between steps. Beyond a radius the
foam may be linear elastic with the hyperfoam's initial modulus (E = 2 mu_0, nu = 0).
"""

import re
import resource
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eitsim.mechanics.solid.grid import Grid, foam_grid
from eitsim.scene.scene import Body, Punch
from matcal.laws.hyperfoam import Hyperfoam

# CalculiX solves a sector of 2 degrees with straight edges.
SECTOR = np.pi / (np.sin(np.radians(1)) * np.cos(np.radians(1)))
# Parts of the target depth between which it is approached in even steps, and their number.
FROM, TO, STEPS = 0.93, 1.10, 17


@dataclass(frozen=True)
class Settings:
    """One way to model the touch in CalculiX."""

    # name of its axisymmetric element: CAX4, CAX8 or CAX8R
    element: str
    # element size at the punch's edge, m
    size_m: float
    # "NODE TO SURFACE" or "SURFACE TO SURFACE"
    pairing: str
    # contact pressure over penetration, kPa/mm
    penalty: float
    # radius beyond which the foam is linear elastic, mm; infinite: nowhere
    elastic_beyond: float
    # largest step on the way, over the target depth
    step: float = 0.1


@dataclass(frozen=True)
class Run:
    """What a run gave."""

    # (increments,) depth, mm, and force, N
    depth: np.ndarray
    force: np.ndarray
    # (increments, nodes, 2) displacement of the top's nodes, mm, from the axis outwards
    surface: np.ndarray
    # (nodes,) their reference radii, mm
    radius: np.ndarray
    cpu_s: float
    # "ok" or why it ended
    outcome: str


def run(law: Hyperfoam, body: Body, punch: Punch, depth_mm: float, settings: Settings, limit_s: int) -> Run:
    """Press to a little beyond a depth in a child process of one thread and at most so many CPU seconds."""
    grid = foam_grid(body, punch, settings.size_m, 1 if settings.element == "CAX4" else 2)
    unit = body.thickness_m * 1e3
    with tempfile.TemporaryDirectory() as folder:
        deck = "\n".join(lines(law, grid, unit, punch, depth_mm, settings)) + "\n"
        (Path(folder) / "touch.inp").write_text(deck)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        outcome = _solve(folder, limit_s)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        depth, force, surface = printed((Path(folder) / "touch.dat").read_text(), depth_mm)
    if outcome == "ok" and (not len(depth) or depth[-1] < 0.999 * TO * depth_mm):
        outcome = "stopped"
    if outcome != "ok":
        outcome += f" at {depth[-1]:.2f} mm" if len(depth) else " at the first increment"
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Run(depth, force, surface, np.unique(grid.nodes[_top(grid, settings), 0]) * unit, cpu, outcome)


def _solve(folder: str, limit_s: int) -> str:
    done = subprocess.run(["ccx", "touch"], cwd=folder, capture_output=True, text=True, check=False,
                          preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s)),
                          env={"PATH": "/usr/local/bin:/usr/bin:/bin", "OMP_NUM_THREADS": "1"})
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return f"stopped after {limit_s} CPU s"
    return "too many cutbacks" if "too many cutbacks" in done.stdout else "ok" if done.returncode == 0 else "failed"


def printed(text: str, depth_mm: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depths, forces and surface displacements at the increments in a .dat file."""
    blocks = re.split(r"\n (?=total force|displacements)", "\n" + text)
    times = np.array([float(b.split("time")[1].split()[0]) for b in blocks if b.startswith("total force")])
    force = np.array([float(b.splitlines()[2].split()[1]) for b in blocks if b.startswith("total force")])
    moved = [np.loadtxt(b.splitlines()[2:], ndmin=2)[:, 1:3] for b in blocks if b.startswith("displacements")]
    depth = depth_mm * np.interp(times, [0, 1, 2], [0, FROM, TO])
    return depth, force * SECTOR / 1e3, np.array(moved)


def lines(law: Hyperfoam, grid: Grid, unit: float, punch: Punch, depth_mm: float, settings: Settings) -> Iterator[str]:
    """Lines of the input file."""
    nodes, around = grid.nodes * unit, grid.counter_clockwise
    cells = around[:, :4] if settings.element == "CAX4" else around[:, :8]
    middle = nodes[around[:, :4]].mean(axis=1)
    far = middle[:, 0] > settings.elastic_beyond
    yield "*NODE"
    yield from (f"{k + 1},{nodes[k, 0]:.9g},{nodes[k, 1]:.9g}" for k in np.unique(cells))
    for name, part in (("NEAR", ~far), ("FAR", far)):
        if part.any():
            yield f"*ELEMENT,TYPE={settings.element},ELSET={name}"
            yield from (f"{e + 1}," + ",".join(str(k + 1) for k in cells[e]) for e in np.flatnonzero(part))
    yield from _punch(punch, len(nodes) + 1, len(cells) + 1)
    yield "*SURFACE,NAME=FOAM"
    reach = punch.diameter_m * 500 + 0.9 * unit
    yield from (f"{e + 1},S3" for e in np.flatnonzero(np.isin(around[:, 2], grid.top) & (middle[:, 0] < reach)))
    free = np.unique(cells)
    for name, which in (("BOTTOM", free[nodes[free, 1] == -unit]), ("AXIS", free[nodes[free, 0] == 0]),
                        ("TOP", _top(grid, settings))):
        yield f"*NSET,NSET={name}"
        yield from (f"{k + 1}," for k in which)
    yield from _material(law, bool(far.any()))
    yield from _steps(depth_mm, settings)


def _punch(punch: Punch, node: int, element: int) -> Iterator[str]:
    """The rigid cup, numbered from these on, and its outer surface."""
    profile, inside = cup(punch.diameter_m * 500, punch.fillet_m * 1e3)
    count = len(profile)
    yield "*NODE,NSET=RIGID"
    yield from (f"{node + k},{r:.9g},{z:.9g}" for k, (r, z) in enumerate(np.vstack([profile, inside])))
    yield "*ELEMENT,TYPE=CAX4,ELSET=PUNCH"
    for k in range(count - 1):
        outer, inner = node + k, node + count + k
        yield f"{element + k},{outer},{outer + 1},{inner + 1},{inner}"
    yield "*SURFACE,NAME=FACE"
    yield from (f"{element + k},S1" for k in range(count - 1))


def _steps(depth_mm: float, settings: Settings) -> Iterator[str]:
    """Frictionless contact and the punch's way, in two parts."""
    yield f"""*SURFACE INTERACTION,NAME=CONTACT
*SURFACE BEHAVIOR,PRESSURE-OVERCLOSURE=LINEAR
{settings.penalty:g},{1e-4 * settings.penalty:g}
*CONTACT PAIR,INTERACTION=CONTACT,TYPE={settings.pairing}
FOAM,FACE
*BOUNDARY
BOTTOM,1,2
AXIS,1
RIGID,1"""
    for share, start, largest in ((FROM, settings.step / 5, settings.step), (TO, 1 / STEPS, 1 / STEPS)):
        yield f"""*STEP,NLGEOM,INC=2000
*STATIC
{start:.6g},1.,1e-5,{largest:.6g}
*BOUNDARY
RIGID,2,2,{-share * depth_mm:.9g}
*NODE PRINT,NSET=BOTTOM,TOTALS=ONLY
RF
*NODE PRINT,NSET=TOP
U
*END STEP"""


def _top(grid: Grid, settings: Settings) -> np.ndarray:
    return np.unique(grid.top if settings.element != "CAX4" else grid.top[:, [0, -1]])


def _material(law: Hyperfoam, elastic: bool) -> Iterator[str]:
    constants = [f"{value:.9g}" for pair in zip(law.mu_Pa / 1e3, law.alpha, strict=True) for value in pair]
    constants += [f"{nu:.9g}" for nu in law.nu]
    yield f"*MATERIAL,NAME=HYPERFOAM\n*HYPERFOAM,N={len(law.mu_Pa)}"
    yield from (",".join(constants[k:k + 8]) for k in range(0, len(constants), 8))
    yield f"*MATERIAL,NAME=ELASTIC\n*ELASTIC\n{law.E_0_Pa / 1e3:.9g},0."
    yield "*SOLID SECTION,ELSET=NEAR,MATERIAL=HYPERFOAM\n*SOLID SECTION,ELSET=PUNCH,MATERIAL=ELASTIC"
    if elastic:
        yield "*SOLID SECTION,ELSET=FAR,MATERIAL=ELASTIC"


def cup(radius: float, fillet: float) -> tuple[np.ndarray, np.ndarray]:
    """Outline of the punch, from the axis along face, fillet (24 chords) and wall, and a parallel line inside it."""
    angle = np.linspace(0, np.pi / 2, 25)
    arc = np.column_stack([np.sin(angle), -np.cos(angle)])
    face, wall = np.linspace(0, radius - fillet, 30)[:-1], np.linspace(fillet, 9.0, 20)[1:]
    outline = np.vstack([np.column_stack([face, np.zeros(len(face))]), [radius - fillet, fillet] + fillet * arc,
                         np.column_stack([np.full(len(wall), radius), wall])])
    inwards = np.vstack([np.tile([0.0, 1.0], (len(face), 1)), -arc, np.tile([-1.0, 0.0], (len(wall), 1))])
    return outline, outline + 0.5 * fillet * inwards
