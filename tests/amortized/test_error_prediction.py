"""Deviations that the training set lacks, and their scores in the residual at an answer."""

import numpy as np
import pytest

from amortized.toys import CHIRP, THESIS, short_setup
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.amortized.error_prediction.comparison import Comparison, predictor_feature_count
from emaphm.amortized.error_prediction.deviations import (
    DeviationSettings,
    delayed,
    deviating,
    deviation_count,
    deviation_directions,
    other_descriptions,
    smooth_friction,
)
from emaphm.amortized.error_prediction.predictor import WRONG, error_ratios
from emaphm.amortized.model_update import Whitening
from emaphm.amortized.networks.mixture import Mixture
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.amortized.simulating import TrainingSet, block_of, simulated
from emaphm.arrays import Array, Single
from emaphm.simulation import AVERAGED

SETUP = short_setup(nuisances=())
INPUTS = SETUP.inputs(CHIRP, AVERAGED.step_for(THESIS))
D, CHANNELS = SETUP.space.dimensions, len(SETUP.channels)
POINTS = 0.2 + 0.3 * np.random.default_rng(0).random((5, D))
NEVER = DeviationSettings(often=0.0, seldom=0.0)


def drawn() -> TrainingSet:
    rows = simulated(SETUP, INPUTS, AVERAGED, POINTS)
    return TrainingSet(POINTS.astype(np.float32), rows)


def test_nothing_is_changed_where_nothing_deviates() -> None:
    changed = deviating(SETUP, INPUTS, drawn(), np.random.default_rng(0), NEVER)
    np.testing.assert_allclose(changed.rows, drawn().rows, atol=1e-5)


def test_rows_come_later_as_a_delay_says() -> None:
    time = np.linspace(0.0, 1.0, 400)
    rows = np.sin(9 * time) + np.zeros((2, 3, 1))
    blocks = np.array([[0.0, 2.0, -3.0], [0.5, -0.25, 2.6]])
    moved = delayed(rows, blocks)
    expected = np.sin(9 * (time - blocks[..., np.newaxis] * time[1]))
    np.testing.assert_allclose(moved[..., 5:-5], expected[..., 5:-5], atol=1e-5)
    np.testing.assert_array_equal(moved[0, 1, :2], rows[0, 1, 0])


def test_another_inertia_is_that_of_another_description() -> None:
    heavier = other_descriptions(SETUP, INPUTS, POINTS)[:, 0]
    described = lumped_parameters(THESIS, ("inertia",))["inertia"]
    actuator = with_lumped_parameters(THESIS, {"inertia": 1.05 * described}, name=THESIS.name)
    other = RecordingSetup.of(actuator, CHIRP, duration=0.1, sample_rate=2000.0, nuisances=())
    np.testing.assert_allclose(heavier, simulated(other, INPUTS, AVERAGED, POINTS), atol=1e-4)
    assert np.ptp(heavier - drawn().rows) > 0.01


def test_a_friction_that_is_smooth_already_stays() -> None:
    once = smooth_friction(THESIS)
    assert once.friction is not None
    assert once.friction.transition_speed is not None
    assert smooth_friction(once) == once


def scores(rows: Single, setup: RecordingSetup = SETUP) -> Array:
    """Return the scores of recordings of POINTS, with correct answers of small uncertainty."""
    width = rows.shape[1] * rows.shape[2]
    whitening = Whitening(
        np.full(len(setup.channels), 0.05), np.zeros(width, np.float32), np.eye(width, dtype=np.float32)
    )
    factor = 1e-3 * np.eye(D)[np.newaxis]
    answers = [Mixture(np.ones(1), point[np.newaxis], factor) for point in POINTS]
    comparison = Comparison.of(setup, INPUTS, rows, answers, np.random.default_rng(1))
    features = comparison.features(setup, whitening, np.ones((len(rows), 2)))
    assert features.shape == (len(rows), predictor_feature_count(len(setup.channels), D))
    return np.asarray(np.sinh(features[:, : deviation_count(len(setup.channels))]))


@pytest.mark.parametrize("which", range(deviation_count(CHANNELS)))
def test_each_deviation_shows_in_its_own_score(which: int) -> None:
    clean = drawn().rows
    along = deviation_directions(clean, other_descriptions(SETUP, INPUTS, POINTS))[:, which]
    size = 0.1 / np.sqrt(np.mean(along**2, axis=(1, 2), keepdims=True))
    found = scores((clean + size * along).astype(np.float32))
    assert np.all(found[:, which] > 5.0)
    assert np.all(found[:, which] >= np.abs(found).max(axis=1) * (1 - 1e-3))
    assert np.abs(scores(clean)).max() < 0.1


def test_a_common_delay_is_a_deviation_if_there_are_several_channels() -> None:
    assert deviation_count(1) == 2 + 3
    assert deviation_count(2) == 2 + 1 + 6
    assert block_of(SETUP.samples) == 1


def test_an_error_counts_relative_to_what_the_answer_states() -> None:
    truths = np.zeros((3, 4))
    means = np.array([[0.06, 0.0, 0.0, 9.0], [0.0, 0.3, 0.0, 0.0], [0.0, 0.0, 0.001, 0.0]])
    variances = np.full((3, 4), 0.05**2)
    variances[0] = 1e-8
    ratios = error_ratios(means, variances, truths, faults=3)
    allowed = WRONG.half_widths * 1.959964 * 0.05
    np.testing.assert_allclose(ratios, [2.0, 0.3 / allowed, WRONG.least], rtol=1e-6)
