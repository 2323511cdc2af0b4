"""Electrodes along the rim: where they lie, how they touch the skin, and which of them are missing."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitsim.scene.drive import Drive, as_tuples, read_out
from touchcal.arrays import Array

# One number for all electrodes, or one for each.
PerElectrode = float | tuple[float, ...]

# Where electrodes of a kind lie: on the edge itself, at the rim of a disc from there inwards, anywhere on the surface.
Place = Enum("Place", ("EDGE", "RIM", "SURFACE"))


@dataclass(frozen=True)
class ElectrodeKind:
    """How electrodes meet the skin."""

    place: Place
    impedance_key: str  # of the contact impedance that they have
    # key -> field of [electrodes] that they leave without effect
    idle: Mapping[str, str]


_POINTED = {"shape": "shape", "turn_deg": "turn_rad", "opening_deg": "opening_rad"}
# Every kind by its name in a scene file; a new one that lies where one of these does is an entry here.
KINDS = {
    "line": ElectrodeKind(Place.EDGE, "contact_impedance_Ohm_m", {
        "contact_impedance_Ohm_m2": "contact_impedance_Ohm_m2", "length_mm": "length_m", "x_mm": "x_m", "y_mm": "y_m",
        **_POINTED}),
    "patch": ElectrodeKind(Place.RIM, "contact_impedance_Ohm_m2", {
        "contact_impedance_Ohm_m": "contact_impedance_Ohm_m", **_POINTED}),
    "surface": ElectrodeKind(Place.SURFACE, "contact_impedance_Ohm_m2", {
        "contact_impedance_Ohm_m": "contact_impedance_Ohm_m", "angles_deg": "angles_rad",
        "first_angle_deg": "first_angle_rad", "clockwise": "clockwise", "positions_mm": "positions_m",
        "shares": "shares"})}
IMPEDANCES = tuple(dict.fromkeys(kind.impedance_key for kind in KINDS.values()))
SHAPES = ("disc", "rectangle", "sector")  # of electrodes on the surface
SIDES = ("top", "bottom")  # of a layer that conducts in its volume
FEWEST, MOST = 4, 64
# Places that an outline's electrodes are given by.
PLACES = ("positions_m", "shares", "x_m", "y_m")
# Gaps up to this angle, rad, are rounding: the electrodes touch.
TOUCHING = 1e-8


@dataclass(frozen=True)
class Electrodes:
    """Electrodes along the rim, one way round: contacts of the rim itself, or sectors of the surface at it; or, on a
    skin with an outline, patches anywhere on the surface."""

    kind: str = "line"  # how they meet the skin, one of KINDS
    count: int = 16  # how many, missing ones too
    width_m: PerElectrode = 0.01  # width along the rim, or of a patch on the surface along its x, m
    # length of patches from the rim inwards, or of a patch on the surface across its width, m
    length_m: PerElectrode = 0.01
    first_angle_rad: float = 0.0  # angle of the middle of the first one from +x, rad; the others follow at even steps
    clockwise: bool = False  # whether even steps go clockwise
    angles_rad: tuple[float, ...] = ()  # (count,) angles of the middles from +x, rad; empty: at even steps
    contact_impedance_Ohm_m: PerElectrode = 1.0  # contact impedance of lines, Ohm m; infinite: no contact
    contact_impedance_Ohm_m2: PerElectrode = 1e-2  # contact impedance of patches, Ohm m^2; infinite: no contact
    missing: tuple[int, ...] = ()  # numbers, from 0, of electrodes without contact
    # (count,) middles along an outline from first_angle_rad, counter-clockwise: arc lengths, m, or shares of the whole
    positions_m: tuple[float, ...] = ()
    shares: tuple[float, ...] = ()
    # (count,) places on the surface, m
    x_m: tuple[float, ...] = ()
    y_m: tuple[float, ...] = ()
    shape: str | tuple[str, ...] = "disc"  # of electrodes on the surface, one of SHAPES, or one an electrode
    turn_rad: PerElectrode = 0.0  # angle of an electrode on the surface from +x, rad
    opening_rad: float = math.pi / 2  # angle that a sector spans about its tip, rad
    soft: bool = False  # whether they give way with the foam, as paint, foil and thin wires do
    # of a layer that conducts in its volume: the side that patches lie on, one of SIDES; and the heights above its base
    # between which lines cover the rim, m, both 0 where they cover all of it
    side: str = "top"
    low_m: float = 0.0
    high_m: float = 0.0

    def __post_init__(self) -> None:
        for name in ("width_m", "length_m", "angles_rad", "contact_impedance_Ohm_m", "contact_impedance_Ohm_m2",
                     "missing", *PLACES, "shape", "turn_rad"):
            object.__setattr__(self, name, as_tuples(getattr(self, name)))

    @property
    def place(self) -> Place | None:
        """Where they lie; None of a kind that is unknown."""
        return KINDS[self.kind].place if self.kind in KINDS else None

    @property
    def along_edge(self) -> bool:
        """Whether they are stretches of the edge itself."""
        return self.place is Place.EDGE

    @property
    def at_rim(self) -> bool:
        """Whether they are sectors of the surface at the rim of a disc."""
        return self.place is Place.RIM

    @property
    def anywhere(self) -> bool:
        """Whether they are patches anywhere on the surface."""
        return self.place is Place.SURFACE

    @property
    def over_thickness(self) -> bool:
        """Whether they are lines that cover the whole height of the rim."""
        return self.along_edge and self.low_m == self.high_m == 0

    @property
    def impedance_key(self) -> str:
        """The field, and the key, of the contact impedance that they have; empty of a kind that is unknown."""
        return KINDS[self.kind].impedance_key if self.kind in KINDS else ""


def widths(electrodes: Electrodes) -> Array:
    """Widths (count,) along the rim, m."""
    return np.broadcast_to(np.asarray(electrodes.width_m, dtype=float), electrodes.count)


def lengths(electrodes: Electrodes) -> Array:
    """Lengths (count,) of patches, m."""
    return np.broadcast_to(np.asarray(electrodes.length_m, dtype=float), electrodes.count)


def turns(electrodes: Electrodes) -> Array:
    """Angles (count,) of electrodes on the surface from +x, rad."""
    return np.broadcast_to(np.asarray(electrodes.turn_rad, dtype=float), electrodes.count)


def middles(electrodes: Electrodes) -> Array:
    """Angles (count,) of the electrodes' middles from +x, rad."""
    if electrodes.angles_rad:
        return np.array(electrodes.angles_rad)
    step = (-2 if electrodes.clockwise else 2) * np.pi / electrodes.count
    return electrodes.first_angle_rad + step * np.arange(electrodes.count, dtype=float)


def round_the_rim(ends: Array) -> tuple[NDArray[np.intp], Array, Array]:
    """Electrodes (count,) with first and last angles (count, 2), rad, counter-clockwise from the first one, their
    angles in that order, within one turn from it on, and the gap (count,) after each of these."""
    middle = ends.mean(axis=1)
    place = np.mod(middle - middle[0], 2 * np.pi)
    order = np.argsort(place, kind="stable")
    turned = (ends + 2 * np.pi * np.round((place + middle[0] - middle) / (2 * np.pi))[:, None])[order]
    return order, turned, np.append(turned[1:, 0], turned[0, 0] + 2 * np.pi) - turned[:, 1]


def contact_impedances(electrodes: Electrodes) -> Array:
    """Contact impedances (count,) of the electrodes' kind, Ohm m or Ohm m^2; infinite where one is missing."""
    given = np.asarray(getattr(electrodes, electrodes.impedance_key), dtype=float)
    out = np.broadcast_to(given, electrodes.count).copy()
    out[list(electrodes.missing)] = np.inf
    return out


def arcs(radius_m: float, electrodes: Electrodes) -> Array:
    """First and last angle (count, 2), rad, of the electrodes on a rim; ValueError where they overlap, or do not
    count one way round."""
    ends = middles(electrodes)[:, None] + widths(electrodes)[:, None] / (2 * radius_m) * np.array([-1.0, 1.0])
    order, _, gaps = round_the_rim(ends)
    one_way = np.all(np.diff(order) == 1) or np.all(np.diff(order[1:]) == -1)
    require(bool(one_way), "angles_deg", "must lie within one turn, all increasing (counter-clockwise) or all "
            "decreasing (clockwise)")
    if gaps.min() >= -TOUCHING:
        return ends
    k = int(np.argmin(gaps))
    fix = "place them further from each other or make them narrower"
    if not electrodes.angles_rad and np.ndim(electrodes.width_m) == 0:
        widest = math.floor(2e6 * math.pi * radius_m / electrodes.count) / 1e3
        fix = f"{electrodes.count} of them at radius_mm = {radius_m * 1e3:g} may be {widest:.3f} wide at most"
    raise ValueError(f"width_mm in [electrodes]: electrodes {order[k]} and {np.roll(order, -1)[k]} (from 0) overlap by "
                     f"{-gaps[k] * radius_m * 1e3:.3g} mm; {fix}.")


def identical(electrodes: Electrodes) -> bool:
    """Whether turning the ring by one electrode changes nothing."""
    sizes = widths(electrodes), contact_impedances(electrodes)
    return not electrodes.angles_rad and all(bool(np.all(size == size[0])) for size in sizes)


@lru_cache(maxsize=16)
def there(electrodes: Electrodes) -> NDArray[np.bool_]:
    """(count,) which electrodes have contact."""
    kept = np.isfinite(contact_impedances(electrodes))
    kept.flags.writeable = False
    return kept


def present(electrodes: Electrodes) -> Electrodes:
    """The electrodes that have contact, by themselves."""
    kept = there(electrodes)
    if kept.all():
        return electrodes
    own: dict[str, Any] = {electrodes.impedance_key: tuple(contact_impedances(electrodes)[kept].tolist())}
    own |= {name: tuple(np.array(given)[kept].tolist()) for name in (*PLACES, "length_m", "shape", "turn_rad")
            if isinstance(given := getattr(electrodes, name), tuple) and given}
    if not any(name in own for name in PLACES):
        own |= {"first_angle_rad": 0.0, "clockwise": False, "angles_rad": tuple(middles(electrodes)[kept].tolist())}
    return replace(electrodes, count=int(kept.sum()), width_m=tuple(widths(electrodes)[kept].tolist()), missing=(),
                   **own)


def among_all(electrodes: Electrodes, impedance_Ohm: Array) -> Array:
    """Impedance matrices of the electrodes with contact within those (..., count, count) of all, NaN for the others."""
    kept = there(electrodes)
    if kept.all():
        return impedance_Ohm
    out = np.full((*impedance_Ohm.shape[:-2], *(electrodes.count,) * 2), np.nan)
    out[..., *np.ix_(kept, kept)] = impedance_Ohm
    return out


def unread(drive: Drive, electrodes: Electrodes) -> NDArray[np.bool_]:
    """(readings,) which of a drive need an electrode without contact; ValueError for a drive that cannot be."""
    count = int(there(electrodes).sum())
    return np.isnan(read_out(drive, among_all(electrodes, np.zeros((count, count))))).ravel()


@lru_cache(maxsize=8)
def check(radius_m: float, electrodes: Electrodes) -> None:
    """ValueError where electrodes cannot be as they are given on a disc; names the key of [electrodes]."""
    require(electrodes.place in (None, Place.EDGE, Place.RIM), "kind", f"\"{electrodes.kind}\" needs an outline in "
            "[body]; a disc is a rectangle whose corner_radius_mm is half of its width_mm and height_mm")
    for name in PLACES:
        require(not getattr(electrodes, name), name.replace("_m", "_mm"), "needs an outline in [body]; on a disc give "
                "angles_deg")
    check_sizes(electrodes)
    require(np.ndim(electrodes.length_m) == 0 and 0 < electrodes.length_m < radius_m, "length_mm",  # type: ignore
            f"must be positive and less than radius_mm = {radius_m * 1e3:g}, got {np.max(electrodes.length_m) * 1e3:g}")
    arcs(radius_m, electrodes)


def check_sizes(electrodes: Electrodes) -> None:
    """ValueError where the electrodes' number, sizes or contact impedances cannot be, or have no effect on their kind.
    """
    require(electrodes.kind in KINDS, "kind", f"'{electrodes.kind}' is unknown; known: {', '.join(KINDS)}")
    require(FEWEST <= electrodes.count <= MOST, "count", f"must be {FEWEST} to {MOST}, got {electrodes.count}")
    sizes = {"width_mm": electrodes.width_m, "length_mm": electrodes.length_m,
             "contact_impedance_Ohm_m": electrodes.contact_impedance_Ohm_m,
             "contact_impedance_Ohm_m2": electrodes.contact_impedance_Ohm_m2}
    places = {"angles_deg": electrodes.angles_rad, "positions_mm": electrodes.positions_m,
              "shares": electrodes.shares}
    numbers = {**sizes, "turn_deg": electrodes.turn_rad, **{key: value or 0.0 for key, value in places.items()}}
    for key, value in numbers.items():
        found = np.size(value)
        other = f"; or write count = {found}" if not electrodes.anywhere and FEWEST <= found <= MOST else ""
        require(np.shape(value) in ((), (electrodes.count,)), key,
                f"must hold {electrodes.count} numbers, one an electrode, got {found}{other}")
        require(key not in sizes or np.all(np.asarray(value) > 0), key, f"must be positive, got {np.min(value):g}")
    _check_kind(electrodes)
    require(not electrodes.angles_rad or electrodes.first_angle_rad == 0, "first_angle_deg",
            "has no effect with angles_deg; leave it out")
    given = [key for key in ("angles_deg", "positions_mm", "shares") if places[key]]
    require(not (given and electrodes.clockwise), "clockwise", f"has no effect with {''.join(given[:1])}; leave it "
            "out, and let the numbers decrease where electrodes count clockwise")
    for k in electrodes.missing:
        require(k in range(electrodes.count), "missing",
                f"must hold numbers of electrodes, 0 to {electrodes.count - 1}, got {k}")


# what has an effect in the place of a key that has none
_INSTEAD = {"contact_impedance_Ohm_m2": "contact_impedance_Ohm_m (impedance times length)",
            "contact_impedance_Ohm_m": "contact_impedance_Ohm_m2 (impedance times area)"}


def _check_kind(electrodes: Electrodes) -> None:
    """What another kind of electrode has is refused where it is given."""
    for key, name in KINDS[electrodes.kind].idle.items():
        fix = f"give {_INSTEAD[key]}" if key in _INSTEAD else "leave it out"
        require(getattr(electrodes, name) == getattr(Electrodes, name), key,
                f"has no effect with kind = \"{electrodes.kind}\"; {fix}")


def require(ok: object, key: str, expected: str) -> None:
    """ValueError that names a key of [electrodes] unless `ok`."""
    if not ok:
        raise ValueError(f"{key} in [electrodes]: {expected}.")
