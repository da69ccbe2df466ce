"""Slow rows: their noise, the commands that are consistent with them, and the effect of another command."""

from dataclasses import replace

import numpy as np
import pytest

from cases import THESIS, USUAL
from emaphm.actuator import Chirp, Command, Faults, Step
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.estimation.finite_differences import one_sided_jacobians
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.uncertainty.slow_rows import step_by_other_command
from emaphm.recording import Recording, other_curve, reconstructed
from emaphm.recording.noise import measured_noise
from emaphm.simulated_recording import simulate
from emaphm.simulation import AVERAGED, REFERENCE
from emaphm.simulation.engine import inputs

KEPT = ("time_s", "command_rad", "current_A")


def recorded(rate: float, duration: float, command: Command, noise: float = 0.05) -> Recording:
    whole = simulate(THESIS, command, duration=duration, sample_rate=rate, noise=noise)
    return Recording({name: whole[name] for name in KEPT})


@pytest.fixture(scope="module")
def slow() -> Recording:
    """Return the recording of a healthy unit at 100 Hz, where the chirp ends at 6.7 rows per cycle."""
    return recorded(100.0, 0.6, Chirp(stop_hz=15.0, duration=0.6))


@pytest.fixture(scope="module")
def diagnosis(slow: Recording) -> Diagnosis:
    return diagnose(slow, THESIS, max_corrections=1, workers=1)  # a second correction triples the time


def test_a_healthy_unit_is_not_called_degraded_at_slow_rows(diagnosis: Diagnosis) -> None:
    assert diagnosis.explained
    assert "degraded" not in {component.verdict for component in diagnosis.components.values()}
    for name in ("friction", "backlash", "short_a", "short_b", "short_c", "eccentricity", "gain"):
        low, high = diagnosis.interval[name]
        assert low <= getattr(Faults(), name) <= high


@pytest.mark.evidence
def test_intervals_are_narrower_at_a_higher_sample_rate() -> None:
    widths = {}
    for rate in (25.0, 500.0):
        recording = recorded(rate, 2.0, Chirp(stop_hz=3.0, duration=2.0))
        diagnosis = diagnose(recording, THESIS, nuisances=USUAL, max_corrections=1, workers=1)
        widths[rate] = {name: np.ptp(diagnosis.interval[name]) for name in ("friction", "backlash", "gain")}
    assert all(widths[25.0][name] > 2 * widths[500.0][name] for name in widths[25.0])


def test_the_model_driven_by_slow_rows_is_accurate() -> None:
    exact = recorded(100.0, 2.0, Chirp(stop_hz=15.0, duration=2.0), noise=0.0)
    problem = problem_of(exact, THESIS, REFERENCE)
    error = problem.predict_primary(Faults().vector[np.newaxis])[0] - exact["current_A"]
    # Akima interpolation had an error of 8 % and more here; switching and the ends of the spline remain.
    assert np.sqrt(np.mean(error**2)) < 0.02 * np.sqrt(np.mean(exact["current_A"] ** 2))


@pytest.mark.parametrize("noise", [0.05, 0.3])
def test_the_measured_noise_of_slow_rows_excludes_jumps(noise: float) -> None:
    current = recorded(200.0, 2.0, Chirp(stop_hz=15.0, duration=2.0), noise)["current_A"]
    by_rms = float(np.sqrt(np.mean(np.diff(current, 2) ** 2) / 6))
    quiet = measured_noise(current, 5e-3)
    assert noise * 0.9 < quiet < max(2 * noise, 0.1)
    assert quiet < by_rms
    assert measured_noise(current, 2e-3) == pytest.approx(by_rms)


def test_the_measured_noise_of_white_noise_is_its_deviation() -> None:
    drawn = np.random.default_rng(0).normal(0.0, 0.2, 20_000)
    assert measured_noise(drawn, 0.1) == pytest.approx(0.2, rel=0.03)  # the error of a median


def averaged_rows(rate: float, duration: float, command: Command) -> Recording:
    """Return a recording by the averaged model."""
    whole = simulate(THESIS, command, model="averaged", duration=duration, sample_rate=rate)
    return Recording({name: whole[name] for name in KEPT})


@pytest.mark.parametrize(
    ("rate", "duration", "command"),
    [
        (5000.0, 0.5, Chirp()),
        (5000.0, 0.5, Step()),
        (100.0, 5.0, Chirp(stop_hz=0.5, duration=5.0)),
    ],
)
def test_fast_rows_have_no_other_possible_command(rate: float, duration: float, command: Command) -> None:
    assert other_curve(averaged_rows(rate, duration, command), "command_rad") is None


def test_slow_rows_have_another_possible_command() -> None:
    rate = 40.0
    recording = averaged_rows(rate, 5.0, Chirp(stop_hz=5.0, duration=5.0))
    curve = other_curve(recording, "command_rad")
    assert curve is not None
    middles = (np.arange(50) + 0.5) / 50 / rate
    times = (recording["time_s"][:, np.newaxis] + middles)[5:-5]
    means = curve(times.ravel()).reshape(times.shape).mean(axis=1)
    # Both curves have the recorded rows as means, and differ between the rows.
    np.testing.assert_allclose(means, recording["command_rad"][5:-5], rtol=0, atol=2e-5)
    assert np.ptp(curve(times.ravel()) - reconstructed(recording, "command_rad")(times.ravel())) > 0


def test_a_jump_in_slow_rows_may_be_a_ramp() -> None:
    whole = simulate(THESIS, Step(start=1.0), model="averaged", duration=5.0, sample_rate=40.0)
    recording = Recording({name: whole[name] for name in KEPT})
    ramp = other_curve(recording, "command_rad")
    assert ramp is not None
    about = np.array([0.98, 0.99, 0.999, 1.0, 1.001, 1.01, 1.02])
    jump = reconstructed(recording, "command_rad")(about)
    np.testing.assert_allclose(jump, Step(start=1.0)(about), atol=1e-12)
    assert np.all(np.diff(ramp(about)) > 0)


def test_a_step_by_another_command_is_the_step_of_a_fit_with_that_command() -> None:
    # With the other command, the outputs at the stepped point are nearer to those of the estimate.
    chirp = Chirp(stop_hz=15.0, duration=1.0)
    whole = simulate(THESIS, chirp, model="averaged", duration=1.0, sample_rate=200.0)
    objective = faults_objective(problem_of(Recording({name: whole[name] for name in KEPT}), THESIS), ())
    faults = Faults(friction=0.2, backlash=0.3, short_a=0.1, short_b=0.1, short_c=0.1, gain=0.4)
    point = objective.space.points(faults.vector[np.newaxis])[0]
    outputs = objective.outputs(point[np.newaxis])[0]
    jacobians = one_sided_jacobians(
        objective.outputs, point[np.newaxis], outputs[np.newaxis], objective.space, 1e-3
    )
    step = step_by_other_command(objective, point, np.full(outputs.size, 0.1), jacobians)
    assert step is not None
    driving = objective.problem.driving
    assert driving.other_command is not None
    other = replace(driving, command=driving.other_command).inputs(AVERAGED.step_for(THESIS))
    with_other = replace(objective, problem=replace(objective.problem, inputs=other))
    deviations = [
        with_other.outputs((point + share * step)[np.newaxis])[0] - outputs for share in (0.0, 1.0, -1.0)
    ]
    unchanged, stepped, opposite = (float(np.sum(deviation**2)) for deviation in deviations)
    assert stepped < 0.9 * unchanged < opposite


def test_inputs_evaluated_in_parts_are_identical(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = inputs.Inputs.of(Chirp(), np.cos, samples=50, interval=1e-3, step=5e-5)
    monkeypatch.setattr(inputs, "MOST_AT_ONCE", 77)
    parts = inputs.Inputs.of(Chirp(), np.cos, samples=50, interval=1e-3, step=5e-5)
    np.testing.assert_array_equal(parts.command, whole.command)
    np.testing.assert_array_equal(parts.load, whole.load)
