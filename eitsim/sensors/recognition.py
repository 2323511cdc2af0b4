"""Which order of readings a frame follows: each is compared with a homogeneous disc, the nearest with imperfect ones;
where the skin has an outline, with that skin, electrode 0 of the readings being any of its electrodes.

A symmetric disc cannot tell orders that differ by a turn or a mirror of some patterns. Imperfections of a real one can:
displaced electrodes, an uneven sheet and unequal channels make the same few numbers of a wrong order a worse account.
The marginal likelihood of a linear model with Gaussian imperfections counts that.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from eitsim.sensors.conventions import MEAN, Convention, conventions, forms, predicted
from eitsim.sensors.disc_field import disc_points, pair_fields, ring_kernel, turned
from eitsim.sensors.outlined_skin import OutlinedSkin, changes, on_body, read_between
from touchcal.arrays import Array, Index

# First comparison: widths of electrodes over their spacing, contact impedances (sheet of 1 S), and the error of such a
# disc, of a reading and of the frame's r.m.s.; Student's t with few degrees keeps single bad channels from deciding.
_WIDTHS, _WIDTH, _CONTACTS = (0.2, 0.5, 0.8), 0.5, (0.0, 0.3, 1.0, 3.0)
_MODEL, _FLOOR, _DEGREES, _LEAST = 0.2, 0.02, 4.0, 1e-3
# How much worse than the best one of the second comparison may be, a reading; most orders looked at, most compared.
_NEAR, _MOST_NEAR, NEAREST = 0.25, 512, 64
# Second comparison: standard deviations of the imperfections granted, all times a common scale: of angles over the
# spacing, of the sheet's waves, of channels' gains, of contacts; and of the kernel's steps. The noise, over the frame's
# r.m.s., and that scale are what fits best; the least noise is the error of such a model.
_ANGLE, _SHEET, _CHANNEL, _CONTACT, _SHAPE, _OWN = 0.02, 0.1, 0.01, 0.3, 0.1, 20.0
_WIDER = 0.3  # of the logarithm of all widths on a skin with an outline
# Orders on such a skin that are compared at once, and of how many readings, about, at first.
_AT_ONCE, _FEW = 1024, 100
_FACTOR = 3.0  # standard deviation of the frame's size over the disc's, both r.m.s. 1
_NOISES, _SCALES = np.geomspace(3e-3, 1.0, 13), (0.0, 0.25, 0.5, 1.0, 2.0, 4.0)


@dataclass(frozen=True, eq=False)
class Order:
    """One order that readings may have."""

    count: int  # electrodes
    pairs: Index  # (readings, 4) source, sink, plus and minus of each; minus MEAN for the mean of all electrodes
    convention: Convention | None = None  # that it follows; None where it is a sensor's own
    # of a sensor's own: way and turn by which its drive, electrodes renumbered, moves against what is read; (1, 0) as
    # described
    moved: tuple[int, int] | None = None
    stated: bool = False  # whether the recording's own file states it
    # way and turn by which electrodes are numbered on a skin with an outline; None where that is open
    placed: tuple[int, int] | None = None


@dataclass(frozen=True, eq=False)
class Account:
    """An order and how well a disc accounts for a frame by it."""

    order: Order
    sign: int  # 1 where readings are plus less minus for current from source to sink, -1 the other sign, 0 no sign
    log_likelihood: float  # natural logarithm, up to what is common to all
    unexplained: float  # 2-norm of what an imperfect disc misses over that of the frame; NaN where none is fitted
    level: float = 0.0  # what is added to all readings, over the frame's r.m.s.


@lru_cache(maxsize=2)
def orders_of_conventions(readings: int, counts: tuple[int, ...]) -> tuple[Order, ...]:
    """Every order of that many readings that a convention makes, once."""
    found: dict[tuple[int, bytes], Order] = {}
    for count in counts:
        for one in conventions(readings, count):
            pairs = one.pairs()
            found.setdefault((count, pairs.tobytes()), Order(count, pairs, one))
    return tuple(found.values())


def stated_order(pairs: Index) -> Order:
    """The order that a recording's file states, with the convention that makes it where there is one."""
    count = int(pairs.max()) + 1
    same = (one for one in orders_of_conventions(len(pairs), (count,)) if np.array_equal(one.pairs, pairs))
    return replace(next(same, Order(count, pairs)), stated=True)


def orders_of_sensor(pairs: Index, count: int) -> list[Order]:
    """A sensor's own order, first, and those in which its drive is renumbered against what is read."""
    return [Order(count, np.column_stack([(way * pairs[:, :2] + turn) % count, pairs[:, 2:]]), moved=(way, turn))
            for way in (1, -1) for turn in range(count)]


def accounts(profile: Array, orders: Sequence[Order], *, signed: bool, skin: OutlinedSkin | None = None,
             level: bool = False, most: int = NEAREST) -> list[Account]:
    """The orders that may have made an untouched frame (readings,), the likeliest first, one of each set that no ring
    can tell.

    signed: whether readings have a sign; level: whether one number is added to all of them. NaN is a dead channel.
    skin: what they are compared with in the place of a disc, electrodes numbered in every way; most: how many orders
    are compared with imperfect discs, those nearest to an even one.
    """
    profile = profile / np.sqrt(np.nanmean(profile**2))
    if skin is not None:
        return _on_skin(profile, orders, skin, signed)
    about, size = 0.0, 1.0
    if level:
        about = float(np.nanmedian(profile))
        size = float(np.sqrt(np.nanmean((profile - about) ** 2))) or 1.0
        profile = (profile - about) / size
    losses, signs = _compared(profile, orders, signed, level)
    nearest = np.argsort(losses, kind="stable")[:_MOST_NEAR]
    ranked = nearest[losses[nearest] < losses.min() + _NEAR * len(profile)] if most == NEAREST else nearest
    classes: dict[tuple[int, bytes], int] = {}
    for k in ranked:
        classes.setdefault((orders[k].count, canonical(orders[k].pairs, orders[k].count, signed)), int(k))
        if len(classes) == most:
            break
    made = [_account(profile, orders[k], int(signs[k]), level=level, noises=_NOISES / size) for k in classes.values()]
    if level:
        shift = -np.isfinite(profile).sum() * np.log(size)
        made = [replace(one, log_likelihood=one.log_likelihood + shift, level=about + size * one.level) for one in made]
    return sorted(made, key=lambda one: -one.log_likelihood)


def account_of(profile: Array, order: Order, *, signed: bool) -> Account:
    """One order's account of a frame (readings,)."""
    profile = profile / np.sqrt(np.nanmean(profile**2))
    _, signs = _compared(profile, [order], signed)
    return _account(profile, order, int(signs[0]))


def numberings(profile: Array, order: Order, skin: OutlinedSkin, *, signed: bool) -> dict[tuple[int, int], float]:
    """Way and turn of electrodes on a skin with an outline -> log likelihood of an order's account so of a frame."""
    profile = profile / np.sqrt(np.nanmean(profile**2))
    placed = [replace(order, placed=(way, turn)) for way in (1, -1) for turn in range(skin.count)]
    _, signs = _compared_on_skin(profile, placed, skin, signed)
    return {one.placed or (1, 0): _account(profile, one, int(sign), skin).log_likelihood
            for one, sign in zip(placed, signs, strict=True)}


def _on_skin(profile: Array, orders: Sequence[Order], skin: OutlinedSkin, signed: bool) -> list[Account]:
    """As `accounts`, of orders whose electrodes are numbered in any way on a skin with an outline, or as they say."""
    ways = [(way, turn) for way in (1, -1) for turn in range(skin.count)]
    placed = [one if way is None else replace(one, placed=way) for one in orders
              for way in (ways if one.placed is None else [None])]
    few = slice(None, None, 1 + len(profile) // _FEW)
    losses, _ = _compared_on_skin(profile, placed, skin, signed, few)
    placed = [placed[k] for k in np.argsort(losses, kind="stable")[:2 * _MOST_NEAR]]
    losses, signs = _compared_on_skin(profile, placed, skin, signed)
    ranked = [k for k in np.argsort(losses, kind="stable")[:_MOST_NEAR]
              if losses[k] < losses.min() + _NEAR * len(profile)]
    best: dict[bytes, Account] = {}
    for k in ranked[:2 * NEAREST]:
        one = _account(profile, placed[k], int(signs[k]), skin)
        key = canonical(one.order.pairs, skin.count, signed)
        if key not in best or one.log_likelihood > best[key].log_likelihood:
            best[key] = one
    return sorted(best.values(), key=lambda one: -one.log_likelihood)


def unordered(profile: Array) -> float:
    """Natural logarithm, as that of an account, of the likelihood that all readings (readings,), or their sizes, are
    one number but for noise: what an order has to be likelier than."""
    profile = profile[np.isfinite(profile)] / np.sqrt(np.nanmean(profile**2))
    return max(_evidence(value, np.array([[len(value)]], dtype=float), np.array([value.sum()]), np.array([_FACTOR]))[0]
               for value in (profile, np.abs(profile)))


def exchanged(order: Order, one: int, other: int) -> Order:
    """An order whose leads of two electrodes are exchanged."""
    leads = np.arange(-1, order.count)
    leads[[one + 1, other + 1]] = other, one
    return replace(order, pairs=leads[order.pairs + 1])


def canonical(pairs: Index, count: int, signed: bool) -> bytes:
    """The same for lists of pairs that differ by a turn or a mirror of the ring or by one sign throughout."""
    found = []
    for corner in pairs[0][pairs[0] != MEAN]:
        for way in (1, -1):
            form = forms(np.where(pairs == MEAN, MEAN, way * (pairs - corner) % count), signed)
            form[:, 4] *= form[0, 4] if signed else 1
            found.append(form.astype(np.int16).tobytes())
    return min(found)


def _compared_on_skin(profile: Array, orders: Sequence[Order], skin: OutlinedSkin, signed: bool,
                      readings: slice = slice(None)) -> tuple[Array, Index]:
    """As `_compared`, by some of the readings."""
    losses, signs = np.full(len(orders), np.inf), np.zeros(len(orders), dtype=np.intp)
    for first in range(0, len(orders), _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        way, turn = np.array([one.placed or (1, 0) for one in orders[some]]).T[:, :, None, None]
        pairs = on_body(np.array([one.pairs[readings] for one in orders[some]]), (way, turn), skin.count)
        for z in skin.impedances:
            loss, sign = _loss(profile[readings], read_between(z, pairs), signed)
            signs[some] = np.where(loss < losses[some], sign, signs[some])
            losses[some] = np.minimum(loss, losses[some])
    return losses, signs


def _compared(profile: Array, orders: Sequence[Order], signed: bool, level: bool = False) -> tuple[Array, Index]:
    """Loss (minus log likelihood) and sign of each order, at the best of some even discs."""
    losses, signs = np.full(len(orders), np.inf), np.zeros(len(orders), dtype=np.intp)
    groups: dict[tuple[int, int, bool], list[int]] = {}
    for k, one in enumerate(orders):
        step = one.convention.step if one.convention and not one.convention.then else 0
        groups.setdefault((one.count, step, driven(one.pairs)), []).append(k)
    for (count, step, on_driven), members in groups.items():
        pairs = np.array([orders[k].pairs for k in members])
        for model in _models(pairs, count, step, on_driven):
            loss, sign = _loss_on_level(profile, model) if level else _loss(profile, model, signed)
            signs[members] = np.where(loss < losses[members], sign, signs[members])
            losses[members] = np.minimum(loss, losses[members])
    return losses, signs


def driven(pairs: Index) -> bool:
    """Whether a reading includes an electrode that carries current."""
    return bool((pairs[:, :2, None] == pairs[:, None, 2:]).any())


def _models(pairs: Index, count: int, step: int, on_driven: bool) -> Iterable[Array]:
    """(orders, readings) of several discs; all orders drive to `step`, 0 where the drives of one differ."""
    if not step:
        flat = pairs.reshape(-1, 4)
        yield from (predicted(flat, kernel).reshape(pairs.shape[:2]) for kernel in _kernels(count, on_driven))
        return
    source, _, plus, minus = np.moveaxis(pairs, -1, 0)
    to_plus, to_minus = (plus - source) % count, np.where(minus == MEAN, count, (minus - source) % count)
    yield from (table[to_plus, to_minus] for table in _tables(count, step, on_driven))


def _kernels(count: int, on_driven: bool) -> list[Array]:
    return [ring_kernel(count, _WIDTH, contact) for contact in _CONTACTS] if on_driven else [
        ring_kernel(count, width) for width in _WIDTHS]


@lru_cache(maxsize=64)
def _tables(count: int, step: int, on_driven: bool) -> tuple[Array, ...]:
    """(count, count + 1) readings by the electrodes from the source to plus and to minus (count: the mean of all), of a
    drive to `step`, for several discs."""
    potentials = [np.append(kernel - np.roll(kernel, step), 0.0) for kernel in _kernels(count, on_driven)]
    return tuple(potential[:-1, None] - potential for potential in potentials)


def _loss(profile: Array, model: Array, signed: bool) -> tuple[Array, Index]:
    """Loss (n,) of models (n, readings) of a profile (readings,) at about their best factor, and its sign."""
    kept = np.isfinite(profile)
    profile, model = profile[kept], model[:, kept]
    model = model / np.sqrt(np.mean(model**2, axis=1, keepdims=True) + 1e-30)
    if signed:
        agreed = np.sign(model) @ np.sign(profile) + model @ profile / np.sqrt(len(profile))
        way = np.where(agreed < 0, -1, 1)
        model = model * way[:, None]
    else:
        way = np.zeros(len(model), dtype=np.intp)
        model, profile = np.abs(model), np.abs(profile)
    ratio = np.log(np.abs(profile) + _LEAST) - np.log(np.abs(model) + _LEAST)
    model = np.exp(np.median(ratio, axis=1))[:, None] * model
    sd = np.hypot(_MODEL * model, _FLOOR)
    return np.sum((_DEGREES + 1) / 2 * np.log1p(((profile - model) / sd) ** 2 / _DEGREES) + np.log(sd), axis=1), way


def _loss_on_level(profile: Array, model: Array) -> tuple[Array, Index]:
    """As `_loss`, of readings that one number is added to: at the factor and the number of least squares."""
    kept = np.isfinite(profile)
    profile, model = profile[kept], model[:, kept]
    middle = model.mean(axis=1, keepdims=True)
    about = model - middle
    factor = about @ profile / (np.sum(about**2, axis=1) + 1e-30)
    model = factor[:, None] * about + profile.mean()
    sd = np.hypot(_MODEL * (model - profile.mean() + factor[:, None] * middle), _FLOOR)
    loss = np.sum((_DEGREES + 1) / 2 * np.log1p(((profile - model) / sd) ** 2 / _DEGREES) + np.log(sd), axis=1)
    return loss, np.where(factor < 0, -1, 1)


def _account(profile: Array, order: Order, sign: int, skin: OutlinedSkin | None = None, *,
             level: bool = False, noises: Array = _NOISES) -> Account:
    kept = np.isfinite(profile)
    value = sign * profile[kept] if sign else np.abs(profile[kept])
    fixed, imperfect = _linear(order.count, order.pairs[kept], sign) if skin is None else _linear_on_skin(
        skin, on_body(order.pairs[kept], order.placed or (1, 0), order.count), sign)
    if level:
        fixed = np.column_stack([np.ones(len(value)), fixed])
    columns = np.column_stack([fixed, imperfect])
    gram, along = columns.T @ columns, columns.T @ value
    log, left = max(_evidence(value, gram, along, np.repeat([1.0, scale], [fixed.shape[1], imperfect.shape[1]]), noises)
                    for scale in _SCALES)
    added = sign * float(np.linalg.lstsq(fixed, value)[0][0]) if level else 0.0
    return Account(order, sign, log, left, added)


def _evidence(value: Array, gram: Array, along: Array, weight: Array, noises: Array = _NOISES) -> tuple[float, float]:
    """Logarithm of the marginal likelihood of a linear model with normal coefficients, whose standard deviations are
    the weights (q,), at the best of _NOISES, and the part of the value that it leaves there; gram (q, q) and along (q,)
    are the products of its columns with each other and with the value."""
    size, turn = np.linalg.eigh(weight[:, None] * gram * weight)
    kept = size > 1e-12 * size[-1]
    size, total = size[kept], float(value @ value)
    seen = (turn[:, kept].T @ (weight * along)) ** 2 / size
    rest = max(total - float(seen.sum()), 1e-12 * total)
    noise = noises[:, None] ** 2
    spread = noise + size
    log = -0.5 * (np.log(spread).sum(axis=1) + (len(value) - len(size)) * np.log(noise[:, 0])
                  + (seen / spread).sum(axis=1) + rest / noise[:, 0])
    k = int(np.argmax(log))
    return float(log[k]), float(np.sqrt((rest + np.sum(seen * (noise[k] / spread[k]) ** 2)) / total))


def _linear(count: int, pairs: Index, sign: int) -> tuple[Array, Array]:
    """Columns (readings, q): readings of an even disc, times a wide prior of their factor, with their changes by the
    shape of the kernel, which the electrodes' width decides; and changes by one standard deviation of imperfections."""
    unit, kernel = np.eye(count), ring_kernel(count, _WIDTH)
    drive = unit[pairs[:, 0]] - unit[pairs[:, 1]]
    read = unit[pairs[:, 2]] - np.where((pairs[:, 3] == MEAN)[:, None], 1 / count, unit[pairs[:, 3]])
    turns = (np.arange(count)[:, None] - np.arange(count)) % count
    value = np.einsum("ie,ie->i", drive @ kernel[turns], read)
    flip = (np.sign(value)[:, None] if sign == 0 else 1.0) / np.sqrt(np.mean(value**2))
    turns_either = np.minimum(turns, count - turns)
    shape = np.stack([np.einsum("ie,ie->i", drive @ (turns_either == k), read) for k in range(count // 2 + 1)], axis=1)
    steps = np.abs(np.diff(kernel[:count // 2 + 1], append=kernel[count // 2]))
    shape *= _SHAPE * np.concatenate([[_OWN * steps[0]], np.maximum(steps[:-1], steps[1:])])
    by_angle = turned(count, _WIDTH)[turns]
    moved = drive * (read @ by_angle.T) + read * (drive @ by_angle.T)
    imperfect = [_ANGLE * 2 * np.pi / count * moved, _SHEET * _by_sheet(pairs, count), _CONTACT * drive * read,
                 _CHANNEL * value[:, None] * unit[pairs[:, 2]]]
    return flip * np.column_stack([_FACTOR * value, shape]), flip * np.column_stack(imperfect)


def _linear_on_skin(skin: OutlinedSkin, pairs: Index, sign: int) -> tuple[Array, Array]:
    """As `_linear`, of a skin with an outline; the shape is that by all widths and all contacts."""
    unit, (value, width, place, sheet) = np.eye(skin.count), changes(skin, pairs)
    drive = unit[pairs[:, 0]] - unit[pairs[:, 1]]
    both = drive * (unit[pairs[:, 2]] - np.where((pairs[:, 3] == MEAN)[:, None], 0.0, unit[pairs[:, 3]]))
    flip = (np.sign(value)[:, None] if sign == 0 else 1.0) / np.sqrt(np.mean(value**2))
    fixed = [_FACTOR * value, _WIDER * width, _OWN * _CONTACT * both.sum(axis=1)]
    imperfect = [_ANGLE * place, _SHEET * sheet, _CONTACT * both, _CHANNEL * value[:, None] * unit[pairs[:, 2]]]
    return flip * np.column_stack(fixed), flip * np.column_stack(imperfect)


def _by_sheet(pairs: Index, count: int) -> Array:
    """(readings, 7) derivatives by the sheet's logarithm along waves over the disc, r^k of angle k and r^2."""
    points, area = disc_points()
    driven, seen = (pair_fields(ends, count, points) for ends in (pairs[:, :2], pairs[:, 2:]))
    radius, angle = np.abs(points), np.angle(points)
    waves = [radius**k * wave(k * angle) for k in (1, 2, 3) for wave in (np.cos, np.sin)] + [2 * radius**2 - 1]
    return -(np.real(np.conj(driven) * seen) * area) @ np.array(waves).T
