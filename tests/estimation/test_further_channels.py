"""What channels that were not recorded would add: nothing of one that is recorded under another name."""

import numpy as np
import pytest

from emaphm.arrays import Array
from emaphm.estimation.objective import CORRELATED_ROWS
from emaphm.estimation.uncertainty.further_channels import UNRECORDED_NOISE, further_channels_information

ROWS = 400
TIME = np.linspace(0.0, 1.0, ROWS)
SHAPES = np.stack([np.sin(9 * TIME), TIME, np.cos(5 * TIME)])
"""What three coordinates make of a signal."""


def replicated(jacobian: Array) -> Array:
    """Return eight replicates of a `jacobian` (d, rows), with errors of 0.1 %."""
    errors = np.random.default_rng(0).normal(0.0, 1e-3, (8, *jacobian.shape))
    return np.asarray(jacobian * (1 + errors))


RECORDED = {"current_A": replicated(SHAPES), "position_rad": replicated(SHAPES[[2, 0, 1]])}


def information(name: str, jacobians: Array, size: float = 1.0) -> Array:
    """Return what a channel of that rms adds to the recorded ones, of rms 1."""
    signals = dict.fromkeys(RECORDED, np.ones(ROWS)) | {name: size * np.ones(ROWS)}
    return further_channels_information(signals, RECORDED | {name: jacobians}, tuple(RECORDED))[name]


def alone(jacobian: Array) -> Array:
    """Return the information of a channel of rms 1 whatever else is recorded."""
    return np.asarray(jacobian @ jacobian.T / (UNRECORDED_NOISE**2 * CORRELATED_ROWS))


def test_a_sum_of_recorded_channels_adds_nothing() -> None:
    both = 2.0 * RECORDED["current_A"] - 0.5 * RECORDED["position_rad"]
    for same in (RECORDED["current_A"], -3.0 * RECORDED["current_A"], both):
        assert np.abs(information("current_q_A", same)).max() < 1e-9 * alone(SHAPES).max()


def test_a_channel_of_its_own_adds_what_it_shows() -> None:
    other = np.stack([np.cos(31 * TIME), np.sin(37 * TIME), np.cos(43 * TIME)])
    np.testing.assert_allclose(information("voltage_V", replicated(other)), alone(other), rtol=0.03, atol=2e3)


def test_a_small_signal_is_as_noisy_as_the_others_in_its_unit() -> None:
    other = np.stack([np.cos(31 * TIME), np.sin(37 * TIME), np.cos(43 * TIME)])
    small = 1e-3 * other
    found = information("current_d_A", replicated(small), size=1e-3)
    np.testing.assert_allclose(found, alone(small), rtol=0.03, atol=2e-3)


def test_what_acts_on_a_recorded_channel_alone_does_not_show_in_another() -> None:
    # As the zero of the current's sensor.
    other = SHAPES * np.array([1.0, 1.0, 0.0])[:, np.newaxis]
    found = information("voltage_V", replicated(other))
    assert np.all(found[2] == 0)
    assert np.all(found[:, 2] == pytest.approx(0.0))
