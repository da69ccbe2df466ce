"""Errors common to repetitions of a manoeuvre are not averaged out; independent noise is."""

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


def test_copies_of_a_recording_add_no_information() -> None:
    # n copies have n times the information I and n² times the covariance S of the scores: I⁻¹ S I⁻¹ stays.
    errors = repeated([white(1)] * 4)
    np.testing.assert_allclose(errors.covariance, 16 * long_run_covariance(white(1)), rtol=1e-9, atol=1e-9)
    assert errors.correlation == pytest.approx(1)


def test_independent_noise_keeps_the_sum_of_covariances() -> None:
    all_errors = [repeated([white(10 * i + k) for k in range(3)]) for i in range(40)]
    correlated = [errors for errors in all_errors if errors.correlation is not None]
    # By chance, one in a hundred counts as correlated; more than 3 of 40 do so in one case of 1500.
    assert len(correlated) <= 3
    for errors in all_errors:
        if errors.correlation is None:
            np.testing.assert_array_equal(errors.covariance, errors.independent)
    # A correlation by chance adds no more than the scatter of a variance.
    assert all(np.trace(errors.covariance) < 1.5 * np.trace(errors.independent) for errors in correlated)


@pytest.mark.parametrize("share", [0.3, 0.8])
def test_an_error_that_is_common_in_part_counts_in_part(share: float) -> None:
    n, all_errors = 4, []
    for i in range(30):
        common = share**0.5 * white(100 * i)
        all_errors.append(
            repeated([common + (1 - share) ** 0.5 * white(100 * i + k) for k in range(1, n + 1)])
        )
    # White of variance 1: the sum over n recordings has ROWS (n + n (n - 1) share).
    expected = ROWS * n * (1 + (n - 1) * share)
    mean_variance = np.mean([np.trace(errors.covariance) / P for errors in all_errors])
    # 45 transforms of 3 coordinates in 30 trials: 2 %; Student's t of 45 adds 5 %.
    assert mean_variance == pytest.approx(expected, rel=0.1)
    correlations = [errors.correlation for errors in all_errors if errors.correlation is not None]
    assert len(correlations) == len(all_errors)
    assert np.mean(correlations) == pytest.approx(share, abs=0.05)


def test_a_repetition_of_part_of_the_rows_is_detected() -> None:
    scores = white(5)
    series = [
        ScoreSeries(scores, CHIRP, 1e-3),
        ScoreSeries(scores[:, 40:-60], CHIRP[40:-60] + 0.5, 1e-3),
        ScoreSeries(scores[:, :-20], CHIRP[:-20], 1e-3),
    ]
    for given in (series, series[::-1]):
        # 6 % of the rows have no counterpart in the other recording.
        assert repeated_errors(given, BOTH).correlation == pytest.approx(0.94, abs=0.04)


def test_different_manoeuvres_and_sample_rates_are_independent() -> None:
    scores = white(7)
    slow = np.sin(2 * np.pi * TIME)
    others = [ScoreSeries(scores, slow, 1e-3), ScoreSeries(scores, CHIRP, 1.1e-3)]
    for other in (*others, ScoreSeries(scores, np.ones(ROWS), 1e-3)):
        errors = repeated_errors([ScoreSeries(scores, CHIRP, 1e-3), other], BOTH)
        assert errors.correlation is None
        np.testing.assert_array_equal(errors.covariance, errors.independent)


def test_coordinates_of_a_single_recording_are_not_shared() -> None:
    # The third and fourth coordinate each belong to one recording, and are 0 in the other.
    scores = white(3)
    none = 0 * scores[2:]
    own = [np.vstack([scores, none]), np.vstack([scores[:2], none, scores[2:]])]
    errors = repeated_errors(
        [ScoreSeries(scores_of_recording, CHIRP, 1e-3) for scores_of_recording in own], np.arange(2)
    )
    expected = long_run_covariance(own[0] + own[1])
    np.testing.assert_allclose(errors.covariance, expected)
    assert errors.correlation == pytest.approx(1)
