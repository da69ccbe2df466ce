"""Means over the swings of a shaft: the same model, in fewer rows."""

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


def test_the_model_is_the_same_in_fewer_rows() -> None:
    every = problem_of(recorded(), COMPLIANT, AVERAGED, channels=None)
    means = over_swings(every)
    assert every.samples == 2050
    assert means.samples == 102
    assert means.duration_s == 102 * 4e-3
    faults = Faults(friction=0.3, backlash=0.5).vector[np.newaxis]
    rows, fewer = every.predict(faults)[0], means.predict(faults)[0]
    for one, other, name in zip(rows, fewer, every.channels, strict=True):
        np.testing.assert_allclose(other, mean_rows(one, 20), atol=1e-6 * np.abs(one).max())
        np.testing.assert_allclose(means.measured[name], mean_rows(every.measured[name], 20))
    assert "20 rows" in notes_on_means(means)[0]


def test_every_row_is_compared_of_a_rigid_shaft_and_of_instants() -> None:
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


def test_rows_that_fill_no_mean_move_no_mask() -> None:
    # 150 rows are left over of 25,150, more than there are means: 125 of 200 rows each.
    means = over_swings(problem_of(recorded(duration=0.503, sample_rate=50_000.0), COMPLIANT, AVERAGED))
    mask = np.arange(25_150) // 200 == 124
    (masked,) = masks_of_means({"current_A": mask}, means).values()
    np.testing.assert_array_equal(np.flatnonzero(masked), [124])
    assert "200 rows" in notes_on_means(means)[0]
