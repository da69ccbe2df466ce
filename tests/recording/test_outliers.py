"""Outliers of a broken sensor are found and replaced; a clean recording is unchanged to the last bit."""

import numpy as np
import pytest

from emaphm.actuator import Actuator, Chirp, Command, Faults, Sampled, Sine, Step
from emaphm.random_streams import stream
from emaphm.recording import Recording
from emaphm.recording.conditioning.outliers import without_outliers
from emaphm.simulated_recording import simulate

PULSES = Sampled(np.array([0.0, 0.1001, 0.1002, 9.0]), np.array([0.0, 0.0, 5e-3, 5e-3]))
"""A step in the middle of a recording: its current pulse is one row long at a low rate."""

CLEAN = [
    (name, command, rate, faults)
    for name, rates in (("thesis", (5000.0, 1000.0)), ("pmsm", (5000.0,)))
    for command in (Chirp(), Sine(5e-3, 4.0), Step(5e-3), PULSES)
    for rate in rates
    for faults in (Faults(), Faults(backlash=0.9))
]


@pytest.mark.parametrize(("name", "command", "rate", "faults"), CLEAN)
def test_a_clean_recording_is_unchanged_to_the_last_bit(
    name: str, command: Command, rate: float, faults: Faults
) -> None:
    actuator = getattr(Actuator, name)()
    recording = simulate(actuator, command, faults=faults, sample_rate=rate, noise=0.02, seed=1)
    cleaned, notes = without_outliers(dict(recording.channels), ())
    assert all(cleaned[name] is recording.channels[name] for name in recording.names)
    assert notes == ()


@pytest.mark.parametrize("rate", [25.0, 100.0, 500.0])
def test_the_current_pulse_at_a_start_is_no_outlier(rate: float) -> None:
    recording = simulate(Actuator.thesis(), PULSES, model="averaged", duration=4.0, sample_rate=rate)
    cleaned, notes = without_outliers(dict(recording.channels), ())
    assert all(cleaned[name] is recording.channels[name] for name in recording.names)
    assert notes == ()


@pytest.mark.parametrize("seed", range(5))
def test_five_spikes_of_22_ampere_are_replaced(healthy: Recording, seed: int) -> None:
    random = stream(seed, "spikes")
    rows = random.choice(np.arange(20, 2400), 5, replace=False)
    spoilt = healthy["current_A"].copy()
    spoilt[rows] = 22.0 * random.choice([-1.0, 1.0], 5)
    mended, notes = without_outliers({**healthy.channels, "current_A": spoilt}, ())
    other_rows = np.setdiff1d(np.arange(healthy.samples), rows)
    np.testing.assert_array_equal(mended["current_A"][other_rows], healthy["current_A"][other_rows])
    # The switching between the hysteresis limits, 0.5 A apart, cannot be predicted from neighbours.
    assert np.abs(mended["current_A"] - healthy["current_A"]).max() < 0.75
    assert [note for note in notes if note.startswith("current_A: 5 outliers")]
    for name in healthy.names:
        if name != "current_A":
            np.testing.assert_array_equal(mended[name], healthy[name])


def test_a_position_that_drops_out_to_zero_is_replaced(healthy: Recording) -> None:
    spoilt = healthy["position_rad"].copy()
    spoilt[[700, 701, 1500]] = 0.0
    mended, notes = without_outliers({**healthy.channels, "position_rad": spoilt}, ())
    np.testing.assert_allclose(mended["position_rad"], healthy["position_rad"], atol=2e-6)
    assert "position_rad: 3 outliers" in notes[-1]
