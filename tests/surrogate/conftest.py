"""Synthetic touches: the exact response of a disc with a circular spot stands in for a simulated sweep; on a rectangle
exact multipoles of its fields do."""

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surrogate
from eitsim.electrics.forward.untouched import untouched_readings
from eitsim.scene.drive import voltage_columns
from eitsim.scene.edges.outline import Outline
from eitsim.scene.scene import Body, Electrodes, Scene
from eitsim.sweeps.dataset import parquet
from surrogate.data import outputs
from surrogate.data.edge_frame import edge_frame
from surrogate.data.samples import SweepSamples, read_samples, take
from surrogate.data.sensor_ring import Ring, place, radial, ring_of, ring_of_design
from surrogate.forward_map import multipole_series
from surrogate.forward_map.forward_map import ForwardMap
from surrogate.forward_map.inversion import rim_starts
from touchcal.array_store import flat
from touchcal.arrays import Array

RADIUS_MM, SHEET_S, CURRENT_A, TERMS = 100.0, 6e-4, 5e-3, 200
RING = ring_of_design({})
RECTANGLE = Scene(Body(Outline("rectangle", width_m=0.15, height_m=0.1), 0.005),
                  electrodes=Electrodes(count=16, width_m=0.008))
# Rows on the rectangle, and those that teach its edges; radius from which an edge counts as near.
RECTANGLE_ROWS, EDGE_ROWS, NEAR = 90, 600, 0.65


def spot(d_mm: Array, force_N: Array) -> tuple[Array, Array]:
    """Radius (mm) and contrast (s1 - s0)/(s1 + s0) of the spot that a synthetic punch makes: smooth, saturating."""
    press = force_N / (d_mm / 14) ** 1.5
    return d_mm / 2 * (1 + 0.06 * press / (1 + press)), 0.55 * press / (press + 1.2)


def spot_signal(x_mm: float, y_mm: float, radius_mm: float, contrast: float) -> Array:
    """(208,) change of the readings, V, by a circular spot of other conductance, point electrodes; exact.

    A Moebius map of the disc onto itself carries the spot to the centre; there the potential between boundary points is
    sum_m cos(m angle) (1 - c rho^2m) / (1 + c rho^2m) / (pi m) over the sheet conductance.
    """
    z0, a = (x_mm + 1j * y_mm) / RADIUS_MM, radius_mm / RADIUS_MM
    turn = np.exp(1j * np.angle(z0)) if z0 else 1.0
    near, far = abs(z0) - a, abs(z0) + a
    half = (1 + near * far) / (near + far) if near + far else np.inf
    pole = half - np.sqrt(half**2 - 1) if np.isfinite(half) else 0.0
    rho = (far - pole) / (1 - pole * far)
    electrode = np.exp(1j * RING.angle_rad) / turn
    angle = np.angle((electrode - pole) / (1 - pole * electrode))
    m = np.arange(1, TERMS + 1)
    change = -2 * contrast * rho ** (2 * m) / (1 + contrast * rho ** (2 * m)) / (np.pi * m * SHEET_S)
    table = np.cos((angle[:, None] - angle)[..., None] * m) @ change
    driven = table[:, RING.source] - table[:, RING.sink]
    reading = np.arange(len(RING.read))
    return CURRENT_A * (driven[RING.read, reading] - driven[RING.ground, reading])


def baseline() -> Array:
    """(208,) readings of the untouched disc with point electrodes, V."""
    point = np.exp(1j * RING.angle_rad)
    to_sink, to_source = (np.abs(point[[RING.read, RING.ground]] - point[end]) for end in (RING.sink, RING.source))
    read, ground = np.log(to_sink / to_source) / (np.pi * SHEET_S)
    return CURRENT_A * (read - ground)


def draw(count: int, seed: int, diameters_mm: Sequence[float] = (), reach_mm: float = 65.0,
         stiffness: Array | float = 1.0) -> tuple[Array, Array]:
    """Touches (count, 4) x, y, d, F uniform over a disc and their exact signals (count, 208), V; d from 10 to 18 mm, or
    of the given ones; forces press foams of this stiffness, over the usual one."""
    rng = np.random.default_rng(seed)
    radius, angle = reach_mm * np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    touch = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), rng.uniform(10, 18, count),
                             rng.uniform(0.1, 2.0, count)])
    if diameters_mm:
        touch[:, 2] = rng.choice(diameters_mm, count)
    radius_mm, contrast = spot(touch[:, 2], touch[:, 3] / stiffness)
    spots = zip(touch[:, 0], touch[:, 1], radius_mm, contrast, strict=True)
    return touch, np.array([spot_signal(*map(float, one)) for one in spots])


def response(touch: Array) -> Array:
    """(n, 4) made-up but smooth mechanical outputs of a touch: peak and mean stress, contact area, depth."""
    d, force = touch[:, 2], touch[:, 3]
    area = np.pi * d**2 / 4 * (1 - 0.1 * np.exp(-3 * force))
    mean = force / area * 1e3
    depth = 9.2 * force / (force + 2.2 * (d / 14) ** 1.6)
    return np.column_stack([mean * (1.5 + 0.2 * np.log(force * 10)), mean, area, depth])


def write_dataset(folder: Path, count: int, seed: int, **changes: Any) -> Path:
    """A synthetic data set in the layout of `eitsim sweep`; `changes` overwrite columns."""
    touch, signal = draw(count, seed)
    touched = signal + baseline()
    rows = []
    for i in range(count):
        row: dict[str, Any] = {"scene": i, "outcome": "ok", "card_sample": -1, "signal_error": 0.0, "cpu_s": 0.0}
        row |= dict(zip(parquet.TOUCH, touch[i], strict=True))
        row |= dict(zip(parquet.OUTPUTS, response(touch)[i], strict=True))
        row |= dict(zip(voltage_columns(208), touched[i], strict=True))
        row |= dict(zip(voltage_columns(208, "dv"), signal[i], strict=True))
        rows.append(row | {key: value[i] for key, value in changes.items()})
    folder.mkdir(parents=True, exist_ok=True)
    parquet.write_part(folder, rows)
    parquet.write_manifest(folder, {"design": {"scenes": count, "seed": seed, "sampler": "random", "tables": {}},
                                    "card": {}, "versions": {}})
    return folder


@pytest.fixture(scope="session", autouse=True)
def foreseen_once() -> Iterator[None]:
    """What a map foresees near the rim takes more than a second: a model that is read again has it from the first."""
    known: dict[str, rim_starts.Foreseen] = {}
    foresee = rim_starts._foreseen

    @lru_cache(maxsize=8)
    def kept(forward: ForwardMap) -> rim_starts.Foreseen:
        digest = sha256()
        for name, value in flat(forward, "forward"):
            digest.update(name.encode() + np.asarray(value).tobytes())
        if (key := digest.hexdigest()) not in known:
            if len(known) == 8:
                known.pop(next(iter(known)))
            known[key] = foresee(forward)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rim_starts, "_foreseen", kept)
        yield


@pytest.fixture(scope="session")
def ring() -> Ring:
    return RING


@pytest.fixture(scope="session")
def synthetic() -> Callable[..., tuple[Array, Array]]:
    """(count, seed[, diameters_mm, reach_mm, stiffness]) -> touches and exact signals."""
    return draw


@pytest.fixture(scope="session")
def spots() -> Callable[..., Array]:
    """(touches, radii in mm, contrasts) -> exact signals of circular spots at the places of the touches."""
    def signals(touch: Array, radius_mm: Array, contrast: Array) -> Array:
        each = zip(touch[:, 0], touch[:, 1], radius_mm, contrast, strict=True)
        return np.array([spot_signal(*map(float, one)) for one in each])
    return signals


@pytest.fixture(scope="session")
def untouched_V() -> Array:
    return baseline()


@pytest.fixture
def make_dataset() -> Callable[..., Path]:
    return write_dataset


@pytest.fixture(scope="session")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A synthetic data set of 200 rows."""
    return write_dataset(tmp_path_factory.mktemp("synthetic") / "sweep", 200, 3)


@pytest.fixture(scope="session")
def samples(sweep: Path) -> SweepSamples:
    found = read_samples(sweep)
    flat = [one for one in outputs.ALL if one.role is not outputs.Role.HEIGHT]
    assert found.target.shape == (200, len(flat))
    return found


@pytest.fixture(scope="session")
def forward_model(samples: SweepSamples) -> surrogate.Model:
    """A forward model of all of them and of all outputs."""
    return surrogate.train(samples, "forward", seed=1)


@pytest.fixture(scope="session")
def inner_model(samples: SweepSamples) -> surrogate.Model:
    """A forward model of so few touches that it learns nothing of the rim, and so answers its first frame at once: for
    what is done with any."""
    return surrogate.train(take(samples, np.arange(100)), "forward", seed=1)


@pytest.fixture(scope="session")
def rectangle() -> Scene:
    """A skin with an outline."""
    return RECTANGLE


@pytest.fixture(scope="session")
def rectangle_ring() -> Ring:
    return ring_of(RECTANGLE)


@pytest.fixture(scope="session")
def rectangle_signal(rectangle_ring: Ring) -> Callable[[Array], Array]:
    """(n, 4) touches on the rectangle -> (n, readings) signals, V, of spots that shunt a part of the field of a circle
    of the punch's diameter."""
    def signals(touch: Array) -> Array:
        contrast = 0.4 * touch[:, 3] / (touch[:, 3] + 0.3)
        order = np.arange(1, multipole_series.ORDERS + 1)
        radius = touch[:, 2, None] / 2 / rectangle_ring.radius_mm
        strength = -1e-2 * contrast[:, None] * radius ** (2 * order) / np.array([1, 2, 12, 144, 2880])
        fields = multipole_series.patterns(rectangle_ring, rectangle_ring.modes, place(rectangle_ring, touch))
        return multipole_series.combined(multipole_series.basis(*fields), strength)
    return signals


def _over_rectangle(ring: Ring, signals: Callable[[Array], Array], rows: int, reach_mm: tuple[float, float],
                    seed: int) -> SweepSamples:
    """Rows of touches evenly over what lies within half widths of the rectangle's middle."""
    rng, rest, number = np.random.default_rng(seed), untouched_readings(RECTANGLE, SHEET_S), np.arange(rows)
    x, y = (rng.uniform(-reach, reach, rows) for reach in reach_mm)
    touch = np.column_stack([x, y, rng.uniform(8, 12, rows), rng.uniform(0.1, 1.0, rows)])
    return SweepSamples(signal_V=signals(touch), target=np.column_stack([touch, rng.uniform(1, 2, (rows, 4))]),
                        group=number, ring=ring, scene=number, baseline_V=np.tile(rest, (rows, 1)),
                        card=np.full(rows, -1), material=np.empty((rows, 0)), signal_sd=np.zeros(rows),
                        row_hash=number.astype(np.uint64), near_edge=radial(ring, touch) > NEAR)


@pytest.fixture(scope="session")
def rectangle_samples(rectangle_ring: Ring, rectangle_signal: Callable[[Array], Array]) -> SweepSamples:
    """Rows over the whole rectangle; signals of those near an edge are not multipoles."""
    def signals(touch: Array) -> Array:
        signal = rectangle_signal(touch)
        signal[radial(rectangle_ring, touch) > NEAR] *= 1 + 0.3 * np.sin(np.arange(signal.shape[1]))
        return signal
    return _over_rectangle(rectangle_ring, signals, RECTANGLE_ROWS, (65.0, 40.0), seed=4)


@pytest.fixture(scope="session")
def rectangle_model(rectangle_samples: SweepSamples) -> surrogate.Model:
    """A forward model of the rectangle."""
    return surrogate.train(rectangle_samples, outputs="x0,y0,d,F", seed=1)


@pytest.fixture(scope="session")
def edge_signal(rectangle_ring: Ring, rectangle_signal: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """(n, 4) touches on the rectangle -> (n, readings) signals, V, to which the nearest edge adds a form of its own."""
    def signals(touch: Array) -> Array:
        z = place(rectangle_ring, touch)
        frame = edge_frame(rectangle_ring, z)
        drive, read = multipole_series.patterns(rectangle_ring, rectangle_ring.modes, z, 1)
        across = (drive[0] * read[0] * frame.outwards[:, None] ** 2).real
        contrast = 0.4 * touch[:, 3] / (touch[:, 3] + 0.3)
        half = touch[:, 2] / 2 / rectangle_ring.radius_mm
        strength = -3e-3 * contrast * half**2 * np.exp(8 * (frame.radial - 0.8))
        return rectangle_signal(touch) + strength[:, None] * across
    return signals


@pytest.fixture(scope="session")
def edge_samples(rectangle_ring: Ring, edge_signal: Callable[[Array], Array]) -> SweepSamples:
    """Rows over the whole rectangle, of which those near an edge can be learned."""
    return _over_rectangle(rectangle_ring, edge_signal, EDGE_ROWS, (68.0, 43.0), seed=6)


@pytest.fixture(scope="session")
def edge_model(edge_samples: SweepSamples) -> surrogate.Model:
    """A forward model of the rectangle that knows touches near one edge."""
    return surrogate.train(edge_samples, outputs="x0,y0,d,F", seed=1)
