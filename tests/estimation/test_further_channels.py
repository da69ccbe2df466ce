"""Information of unrecorded channels: none from a channel that is a combination of recorded ones."""

import numpy as np
import pytest

from emaphm.arrays import Array
from emaphm.estimation.objective import CORRELATED_ROWS
from emaphm.estimation.uncertainty.further_channels import UNRECORDED_NOISE, further_channels_information

ROWS = 400
TIME = np.linspace(0.0, 1.0, ROWS)
SHAPES = np.stack([np.sin(9 * TIME), TIME, np.cos(5 * TIME)])
"""Derivatives of a signal by three coordinates."""


def replicated(jacobian: Array) -> Array:
    """Return eight replicates of a `jacobian` (d, rows), with errors of 0.1 %."""
    errors = np.random.default_rng(0).normal(0.0, 1e-3, (8, *jacobian.shape))
    return np.asarray(jacobian * (1 + errors))


RECORDED = {"current_A": replicated(SHAPES), "position_rad": replicated(SHAPES[[2, 0, 1]])}


def information(name: str, jacobians: Array, size: float = 1.0) -> Array:
    """Return the information that a channel of rms `size` adds to the recorded ones, of rms 1."""
    signals = dict.fromkeys(RECORDED, np.ones(ROWS)) | {name: size * np.ones(ROWS)}
    return further_channels_information(signals, RECORDED | {name: jacobians}, tuple(RECORDED))[name]


def alone(jacobian: Array) -> Array:
    """Return the information of a channel of rms 1 without regard to the recorded channels."""
    return np.asarray(jacobian @ jacobian.T / (UNRECORDED_NOISE**2 * CORRELATED_ROWS))


def test_a_sum_of_recorded_channels_adds_nothing() -> None:
    combination = 2.0 * RECORDED["current_A"] - 0.5 * RECORDED["position_rad"]
    for same in (RECORDED["current_A"], -3.0 * RECORDED["current_A"], combination):
        assert np.abs(information("current_q_A", same)).max() < 1e-9 * alone(SHAPES).max()


def test_an_independent_channel_adds_its_full_information() -> None:
    other = np.stack([np.cos(31 * TIME), np.sin(37 * TIME), np.cos(43 * TIME)])
    np.testing.assert_allclose(information("voltage_V", replicated(other)), alone(other), rtol=0.03, atol=2e3)


def test_a_small_signal_has_the_noise_of_the_other_channels_of_its_unit() -> None:
    other = np.stack([np.cos(31 * TIME), np.sin(37 * TIME), np.cos(43 * TIME)])
    small = 1e-3 * other
    added = information("current_d_A", replicated(small), size=1e-3)
    np.testing.assert_allclose(added, alone(small), rtol=0.03, atol=2e-3)


def test_an_error_of_a_recorded_channel_alone_gets_no_information_from_another() -> None:
    # For example, the zero error of the current sensor.
    other = SHAPES * np.array([1.0, 1.0, 0.0])[:, np.newaxis]
    added = information("voltage_V", replicated(other))
    assert np.all(added[2] == 0)
    assert np.all(added[:, 2] == pytest.approx(0.0))
