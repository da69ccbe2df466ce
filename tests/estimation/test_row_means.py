"""Means of rows over the oscillations of a compliant shaft: the same model, with fewer rows."""

import numpy as np

from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.law_sections import Transmission
from emaphm.estimation.posing import problem_of
from emaphm.estimation.rows.means import masks_of_means, mean_rows, notes_on_means, over_swings
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate
from emaphm.simulation import AVERAGED

RIGID = Actuator.thesis()
COMPLIANT = RIGID.model_copy(update={"transmission": Transmission(stiffness=61.6, damping=1.96e-3)})


def recorded(sampling: str = "mean", duration: float = 0.4101, sample_rate: float = 5000.0) -> Recording:
    command = Chirp(amplitude=5e-3, stop_hz=15)
    whole = simulate(RIGID, command, duration=duration, sample_rate=sample_rate, noise=0.05, seed=3)
    kept = {name: whole[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")}
    return Recording(kept, sampling="mean" if sampling == "mean" else "instant")


def test_the_model_of_means_is_the_mean_of_the_model() -> None:
    all_rows = problem_of(recorded(), COMPLIANT, AVERAGED, channels=None)
    means = over_swings(all_rows)
    assert all_rows.samples == 2050
    assert means.samples == 102
    assert means.duration_s == 102 * 4e-3
    faults = Faults(friction=0.3, backlash=0.5).vector[np.newaxis]
    rows, fewer = all_rows.predict(faults)[0], means.predict(faults)[0]
    for row_values, mean_values, name in zip(rows, fewer, all_rows.channels, strict=True):
        np.testing.assert_allclose(
            mean_values, mean_rows(row_values, 20), atol=1e-6 * np.abs(row_values).max()
        )
        np.testing.assert_allclose(means.measured[name], mean_rows(all_rows.measured[name], 20))
    assert "20 rows" in notes_on_means(means)[0]


def test_rows_of_a_rigid_shaft_or_of_instants_are_not_averaged() -> None:
    rigid = problem_of(recorded(), RIGID, AVERAGED, channels=None)
    assert over_swings(rigid) is rigid
    assert not notes_on_means(rigid)
    instants = problem_of(recorded("instant"), COMPLIANT, AVERAGED, channels=None)
    assert over_swings(instants) is instants


def test_a_mean_of_an_unusable_row_is_unusable() -> None:
    means = over_swings(problem_of(recorded(), COMPLIANT, AVERAGED, channels=None))
    mask = np.zeros(2050, bool)
    mask[[45, 2045]] = True
    np.testing.assert_array_equal(
        np.flatnonzero(masks_of_means({"current_A": mask}, means)["current_A"]), [2]
    )


def test_remaining_rows_do_not_shift_the_mask() -> None:
    # 150 of 25,150 rows remain, more than the number of means: 125 means of 200 rows each.
    means = over_swings(problem_of(recorded(duration=0.503, sample_rate=50_000.0), COMPLIANT, AVERAGED))
    mask = np.arange(25_150) // 200 == 124
    (masked,) = masks_of_means({"current_A": mask}, means).values()
    np.testing.assert_array_equal(np.flatnonzero(masked), [124])
    assert "200 rows" in notes_on_means(means)[0]
