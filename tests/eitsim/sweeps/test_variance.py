"""Parts of a variance: known models, sums that hold exactly, another code's estimates, intervals that cover."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.stats import sobol_indices

from eitsim.sweeps.sobol.variance_components import Shares, Variances, pooled, shares, variances
from touchcal.arrays import Array


def corners(model: Callable[..., Array], groups: list[Array]) -> Array:
    """Values (n, 2, ..., 2, P) of a model at all corners of groups (n, 2, ...), a pair of values a block."""
    k = len(groups)
    out = [model(*(group[:, int(bit)] for group, bit in zip(groups, f"{i:0{k}b}", strict=True))) for i in range(2**k)]
    return np.stack(out, axis=1).reshape(len(groups[0]), *(2,) * k, -1)


def uniform(n: int, size: int, seed: int) -> Array:
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (n, 2, size))


def normal(n: int, seed: int) -> Array:
    return np.random.default_rng(seed).standard_normal((n, 2))


def indices(y: Array, **options) -> Shares:
    return shares(variances(y), np.sqrt((y**2).reshape(-1, y.shape[-1]).mean(axis=0)), **options)


def ishigami(first: Array, rest: Array) -> Array:
    x2, x3 = rest.T
    return np.sin(first[:, 0]) * (1 + 0.1 * x3**4) + 7 * np.sin(x2)**2


def test_groups_of_the_ishigami_function() -> None:
    """x1 against (x2, x3): the closed index of the pair is S_2, as x3 acts through x1 only."""
    found = indices(corners(ishigami, [uniform(40000, 1, 1), uniform(40000, 2, 2)]))
    assert found.first[:, 0] == pytest.approx([0.3139, 0.4424], abs=0.012)
    assert found.total[:, 0] == pytest.approx([0.5576, 0.6861], abs=0.012)
    assert found.deviation[0]**2 == pytest.approx(13.8446, rel=0.02)


def test_a_linear_model_has_no_interactions() -> None:
    y = corners(lambda a, b, c: np.stack([a + 3 * b + 2 * c + 1e6, b], axis=1), [normal(4000, i) for i in range(3)])
    found = indices(y)
    assert found.first[:, 0] == pytest.approx([1 / 14, 9 / 14, 4 / 14], abs=0.02)
    assert found.total == pytest.approx(found.first, abs=1e-7)
    assert found.spread[:, 0] == pytest.approx([1, 3, 2], rel=0.05)
    assert found.first[:, 1] == pytest.approx([0, 1, 0], abs=1e-12)


def test_parts_sum_to_the_whole_exactly() -> None:
    """With two factors V_1 + V_12 + V_2 is the whole in every block: totals plus firsts are twice it."""
    parts = variances(np.random.default_rng(0).standard_normal((50, 2, 2, 3)))
    assert (parts.first + parts.total).sum(axis=0) == pytest.approx(2 * parts.whole, abs=1e-12)


def test_it_is_the_mean_of_what_scipy_makes_of_a_block_read_in_its_four_ways() -> None:
    """scipy takes off the mean of the rows that a way uses, and the means of two ways differ a little."""
    y = corners(ishigami, [uniform(256, 1, 3), uniform(256, 2, 4)])[..., 0]
    first, total, means = [], [], []
    for a, b in ((0, 0), (0, 1), (1, 0), (1, 1)):
        base, other = y[:, a, b], y[:, 1 - a, 1 - b]
        mixed = np.stack([y[:, 1 - a, b][None], y[:, a, 1 - b][None]])
        means.append(np.mean([base, other]))
        scale = np.var([base, other])
        told = sobol_indices(func={"f_A": base[None], "f_B": other[None], "f_AB": mixed}, n=256)
        first.append(told.first_order * scale)
        total.append(told.total_order * scale)
    ours = variances(y[..., None])
    assert ours.total.mean(axis=1)[:, 0] == pytest.approx(np.mean(total, axis=0).ravel(), rel=1e-10)
    assert ours.first.mean(axis=1)[:, 0] == pytest.approx(np.mean(first, axis=0).ravel(), abs=np.ptp(means)**2 + 1e-10)


def test_reading_blocks_in_all_ways_steadies_the_indices() -> None:
    ours, theirs = [], []
    for seed in range(120):
        y = corners(ishigami, [uniform(64, 1, 2 * seed), uniform(64, 2, 2 * seed + 1)])
        found = indices(y)
        ours.append([*found.first[:, 0], *found.total[:, 0]])
        z = y[..., 0]
        told = sobol_indices(n=64, func={"f_A": z[:, 0, 0][None], "f_B": z[:, 1, 1][None],
                                         "f_AB": np.stack([z[:, 1, 0][None], z[:, 0, 1][None]])})
        theirs.append([*told.first_order.ravel(), *told.total_order.ravel()])
    assert (np.std(theirs, axis=0) / np.std(ours, axis=0) > 1.3).all()


def test_noise_of_each_value_is_no_variance_of_a_factor_alone() -> None:
    rng = np.random.default_rng(5)
    y = corners(lambda a, b: a + b, [normal(20000, 6), normal(20000, 7)])
    parts = variances(y + rng.standard_normal(y.shape))
    assert parts.first.mean(axis=1)[:, 0] == pytest.approx([1, 1], abs=0.06)
    assert parts.total.mean(axis=1)[:, 0] == pytest.approx([2, 2], abs=0.06)


def test_a_vector_weighs_its_parts_by_their_variance() -> None:
    y = corners(lambda a, b: np.stack([10 * a, b], axis=1), [normal(500, 8), normal(500, 9)])
    whole = pooled(variances(y))
    each = variances(y)
    assert whole.whole == pytest.approx(each.whole.mean(axis=1, keepdims=True))
    assert shares(whole, [1.0]).first[:, 0] == pytest.approx([100 / 101, 1 / 101], abs=0.003)


@pytest.mark.parametrize(("cards", "blocks", "least", "most"), [
    (120, 60, 0.87, 0.99), (20, 200, 0.87, 0.99), (200, 600, 0.9, 0.995), (4, 200, 0.8, 0.97)])
def test_intervals_cover_as_often_as_they_say(cards: int, blocks: int, least: float, most: float) -> None:
    """Of 200 small studies about 95 % cover the index 1/2 of t + c, whether cards come again or not; binomial limits of
    four standard deviations about 0.93, with four cards, 3 degrees of freedom, about 0.89."""
    covered = 0
    for i in range(200):
        rng = np.random.default_rng(i)
        cycles = [rng.permutation(cards) for _ in range(-(-2 * blocks // cards))]
        number = np.concatenate(cycles)[:2 * blocks].reshape(blocks, 2)
        value = rng.standard_normal(cards)[number]
        found = indices(corners(lambda t, c: t + c, [rng.standard_normal((blocks, 2)), value]), cards=number)
        covered += found.first_ends[0, 1, 0] <= 0.5 <= found.first_ends[1, 1, 0]
    assert least <= covered / 200 <= most


def test_more_blocks_of_the_same_cards_do_not_narrow_intervals() -> None:
    value, widths = np.random.default_rng(3).standard_normal(6), []
    for blocks in (300, 3000):
        rng = np.random.default_rng(4)
        number = np.concatenate([rng.permutation(6) for _ in range(blocks // 3)]).reshape(blocks, 2)
        y = corners(lambda t, c: t + c, [rng.standard_normal((blocks, 2)), value[number]])
        widths += [float(np.diff(indices(y, **given).first_ends[:, 1, 0], axis=0)[0])
                   for given in ({"cards": number}, {})]
    assert widths[2] > 0.8 * widths[0] > 3 * 0.8 * widths[1]
    assert widths[3] < 0.4 * widths[1]


def test_two_cards_tell_no_interval() -> None:
    found = indices(np.random.default_rng(0).standard_normal((30, 2, 2, 1)), cards=np.tile([0, 1], (30, 1)))
    assert found.first_ends[:, :, 0].tolist() == [[0.0, 0.0], [1.0, 1.0]]


def test_what_does_not_vary_has_no_indices() -> None:
    found = indices(np.stack([np.ones((9, 2, 2)), np.random.default_rng(0).standard_normal((9, 2, 2))], axis=-1))
    assert np.isnan(found.first[:, 0]).all()
    assert np.isfinite(found.first[:, 1]).all()
    assert found.spread[:, 0].tolist() == [0.0, 0.0]


def test_mistakes_are_named() -> None:
    with pytest.raises(ValueError, match="one axis of 2 a factor"):
        variances(np.zeros((4, 3, 2, 1)))
    one = variances(np.zeros((1, 2, 2, 1)))
    assert isinstance(one, Variances)
    with pytest.raises(ValueError, match="two or more"):
        shares(one, [1.0])
    with pytest.raises(ValueError, match="two numbers a block"):
        shares(variances(np.zeros((4, 2, 2, 1))), [1.0], cards=[1, 2, 3, 4])
