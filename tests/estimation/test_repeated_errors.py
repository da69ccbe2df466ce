"""What repetitions of a manoeuvre have in common is not averaged away; independent noise is."""

from collections.abc import Sequence

import numpy as np
import pytest

from emaphm.arrays import Array
from emaphm.estimation.uncertainty.long_run_variance import long_run_covariance
from emaphm.estimation.uncertainty.repeated_errors import RepeatedErrors, ScoreSeries, repeated_errors

ROWS, P = 1200, 3
TIME = np.arange(ROWS) * 1e-3
CHIRP = np.sin(2 * np.pi * (1 + 2 * TIME) * TIME)
BOTH = np.arange(P)


def white(seed: int, rows: int = ROWS) -> Array:
    return np.random.default_rng(seed).normal(size=(P, rows))


def repeated(scores: Sequence[Array], driving: Array = CHIRP) -> RepeatedErrors:
    return repeated_errors([ScoreSeries(score, driving, 1e-3) for score in scores], BOTH)


def test_copies_know_no_more_than_one() -> None:
    # n copies have n times the information I and n² times the covariance S of the scores: I⁻¹ S I⁻¹ stays.
    found = repeated([white(1)] * 4)
    np.testing.assert_allclose(found.covariance, 16 * long_run_covariance(white(1)), rtol=1e-9, atol=1e-9)
    assert found.correlation == pytest.approx(1)


def test_independent_noise_adds_up_as_before() -> None:
    found = [repeated([white(10 * i + k) for k in range(3)]) for i in range(40)]
    alike = [one for one in found if one.correlation is not None]
    # By chance one in a hundred counts as alike; of 40, more than 3 do so in one case of 1500.
    assert len(alike) <= 3
    for one in found:
        if one.correlation is None:
            np.testing.assert_array_equal(one.covariance, one.independent)
    # Where chance has made them alike, what is added is of its size: the scatter of a variance.
    assert all(np.trace(one.covariance) < 1.5 * np.trace(one.independent) for one in alike)


@pytest.mark.parametrize("share", [0.3, 0.8])
def test_an_error_that_is_common_in_part_counts_in_part(share: float) -> None:
    n, found = 4, []
    for i in range(30):
        common = share**0.5 * white(100 * i)
        found.append(repeated([common + (1 - share) ** 0.5 * white(100 * i + k) for k in range(1, n + 1)]))
    # White of variance 1: the sum over n recordings has ROWS (n + n (n - 1) share).
    expected = ROWS * n * (1 + (n - 1) * share)
    found_mean = np.mean([np.trace(one.covariance) / P for one in found])
    # 45 transforms of 3 coordinates in 30 trials: 2 %; Student's t of 45 adds 5 %.
    assert found_mean == pytest.approx(expected, rel=0.1)
    correlations = [one.correlation for one in found if one.correlation is not None]
    assert len(correlations) == len(found)
    assert np.mean(correlations) == pytest.approx(share, abs=0.05)


def test_a_repetition_that_begins_later_and_ends_sooner_is_recognised() -> None:
    scores = white(5)
    series = [
        ScoreSeries(scores, CHIRP, 1e-3),
        ScoreSeries(scores[:, 40:-60], CHIRP[40:-60] + 0.5, 1e-3),
        ScoreSeries(scores[:, :-20], CHIRP[:-20], 1e-3),
    ]
    for given in (series, series[::-1]):
        # Of rows that 6 % of the pairs lack.
        assert repeated_errors(given, BOTH).correlation == pytest.approx(0.94, abs=0.04)


def test_other_manoeuvres_and_rates_are_independent() -> None:
    scores = white(7)
    slow = np.sin(2 * np.pi * TIME)
    others = [ScoreSeries(scores, slow, 1e-3), ScoreSeries(scores, CHIRP, 1.1e-3)]
    for other in (*others, ScoreSeries(scores, np.ones(ROWS), 1e-3)):
        found = repeated_errors([ScoreSeries(scores, CHIRP, 1e-3), other], BOTH)
        assert found.correlation is None
        np.testing.assert_array_equal(found.covariance, found.independent)


def test_coordinates_of_one_recording_alone_count_for_it() -> None:
    # The third coordinate of either is the other's own: 0 there.
    scores = white(3)
    none = 0 * scores[2:]
    own = [np.vstack([scores, none]), np.vstack([scores[:2], none, scores[2:]])]
    found = repeated_errors([ScoreSeries(one, CHIRP, 1e-3) for one in own], np.arange(2))
    expected = long_run_covariance(own[0] + own[1])
    np.testing.assert_allclose(found.covariance, expected)
    assert found.correlation == pytest.approx(1)
