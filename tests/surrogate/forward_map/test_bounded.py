import numpy as np
import pytest
from scipy.stats import truncnorm

from surrogate.forward_map.inversion import reading_covariance

COVARIANCE = np.array([[[0.5, 0.2, 0.1], [0.2, 0.04**2 * 60, 0.03], [0.1, 0.03, 0.3]]])


@pytest.mark.parametrize("at", [-1.2, -0.7, 0.0, 0.4, 1.0, 1.7])
def test_the_mean_is_that_of_the_truncated_normal_and_others_follow_by_regression(at: float) -> None:
    mean, sd = np.array([[0.3, at, -1.0]]), float(np.sqrt(COVARIANCE[0, 1, 1]))
    held = reading_covariance.truncated_normal_mean(mean, COVARIANCE, 1, -0.5, 1.0)
    assert held[0, 1] == pytest.approx(truncnorm.mean((-0.5 - at) / sd, (1.0 - at) / sd, at, sd), rel=1e-9)
    follows = COVARIANCE[0, :, 1] / COVARIANCE[0, 1, 1]
    assert held[0] - mean[0] == pytest.approx(follows * (held[0, 1] - at))


def test_far_within_nothing_changes_and_far_outside_the_bound_is_not_believed() -> None:
    sharp = COVARIANCE * 1e-4
    for at in (0.2, 1.5, -0.9):
        mean = np.array([[0.3, at, -1.0]])
        assert reading_covariance.truncated_normal_mean(mean, sharp, 1, -0.5, 1.0) == pytest.approx(mean, abs=1e-12)


def test_a_certain_value_is_left() -> None:
    mean = np.array([[0.3, 0.2, -1.0], [0.3, 1.2, -1.0]])
    assert np.array_equal(reading_covariance.truncated_normal_mean(mean, np.zeros((2, 3, 3)), 1, -0.5, 1.0), mean)
