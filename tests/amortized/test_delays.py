"""Delays of a row: detected if the residual of the shifted recording is clearly smaller, and only then."""

from dataclasses import replace

import numpy as np
import pytest

from amortized.toys import THESIS, constant_estimator
from emaphm.actuator import Chirp, Faults
from emaphm.amortized.applicability import delays
from emaphm.amortized.diagnosing import answer_alone, diagnose_by
from emaphm.amortized.error_prediction.comparison import Comparison
from emaphm.amortized.estimator import Estimator
from emaphm.amortized.model_update import Whitening
from emaphm.amortized.networks.mixture import Mixture
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.amortized.simulating import block_of, simulated
from emaphm.arrays import Array
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate
from emaphm.simulation import AVERAGED

TRUTH = Faults(friction=0.4, backlash=0.3, short_b=0.2, eccentricity=0.3, eccentricity_phase=0.7, gain=0.6)
SETUP = RecordingSetup.of(THESIS, Chirp())
SURE = constant_estimator(SETUP, SETUP.space.points(TRUTH.vector), 1e-3)
INPUTS = SETUP.inputs(Chirp(), AVERAGED.step)
BOTH = ("current_A", "voltage_V")


@pytest.fixture(scope="module")
def recording() -> Recording:
    whole = simulate(THESIS, Chirp(), faults=TRUTH, model="averaged")
    return Recording({name: whole[name] for name in ("time_s", "command_rad", *BOTH)})


def delayed(recording: Recording, rows: int, names: tuple[str, ...]) -> Recording:
    at = np.clip(np.arange(recording.samples) - rows, 0, recording.samples - 1)
    return Recording({name: recording[name][at] if name in names else recording[name] for name in recording})


def clause_of(recording: Recording, estimator: Estimator = SURE) -> str | None:
    rows = delays.shifted_rows(estimator, recording)
    answers, rng = estimator.answers(rows, INPUTS), np.random.default_rng(0)
    return delays.delay_clause(estimator, Comparison.of(SETUP, INPUTS, rows, answers, rng))


@pytest.fixture
def residuals_of_shifts(recording: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace residuals by the difference from the recording without a delay, plus a little noise."""
    unshifted = SURE.rows(recording)

    def sizes(_estimator: Estimator, comparison: Comparison) -> tuple[list[float], float]:
        return [float(np.mean((rows - unshifted) ** 2)) + 1e-3 for rows in comparison.rows], 100.0

    monkeypatch.setattr(delays, "_residual_sizes", sizes)


@pytest.mark.parametrize("names", [BOTH, ("current_A",)])
@pytest.mark.parametrize(("rows", "direction"), [(1, "late"), (-1, "early")])
@pytest.mark.usefixtures("residuals_of_shifts")
def test_a_row_of_delay_is_detected(
    recording: Recording, rows: int, direction: str, names: tuple[str, ...]
) -> None:
    group = "current_A" if names != BOTH else "all that was measured"
    clause = f"{group} seems to come a row {direction}: shifted back, its residual is smaller"
    assert clause_of(delayed(recording, rows, names)) == clause


@pytest.mark.usefixtures("residuals_of_shifts")
def test_a_recording_without_a_delay_has_none(recording: Recording) -> None:
    assert clause_of(recording) is None


def test_equal_residuals_for_both_shifts_are_no_delay(
    recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes: dict[str, list[float]] = {"now": []}
    monkeypatch.setattr(delays, "_residual_sizes", lambda *_: (sizes["now"], 100.0))
    sizes["now"] = [1.2, 1.0, 1.3, 1.1, 1.2]
    assert clause_of(recording) is None
    sizes["now"] = [1.2, 1.0, 1.5, 1.1, 1.2]
    assert "all that was measured seems to come a row early" in str(clause_of(recording))


def test_a_degraded_gain_may_be_a_delay_if_a_delay_hardly_changes_the_residual(
    recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    equal = [1.0] * 5
    monkeypatch.setattr(delays, "_residual_sizes", lambda *_: (equal, 7.9))
    assert str(clause_of(recording)).startswith("its gain may be a delay: a delay of one row would change")
    healthy_gain = constant_estimator(SETUP, SETUP.space.points(replace(TRUTH, gain=0.5).vector), 1e-3)
    assert clause_of(recording, healthy_gain) is None
    monkeypatch.setattr(delays, "_residual_sizes", lambda *_: (equal, 8.1))
    assert clause_of(recording) is None


def test_the_effect_of_a_delay_is_its_projected_length() -> None:
    rows = SETUP.samples // block_of(SETUP.samples) * len(BOTH)
    first_rows = Whitening(np.ones(2), np.zeros(rows, np.float32), np.eye(rows, 40, dtype=np.float32))
    estimator = replace(SURE, update=replace(SURE.update, whitening=first_rows))
    points = SETUP.space.points(TRUTH.vector)[np.newaxis]
    modelled = simulated(SETUP, INPUTS, AVERAGED, points)
    answers = [Mixture(np.ones(1), points, 1e-6 * np.eye(points.size)[np.newaxis])]
    compared = Comparison.of(SETUP, INPUTS, modelled, answers, np.random.default_rng(0))
    residuals, change = delays._residual_sizes(estimator, compared)
    slope = np.gradient(modelled[0, 0].astype(float))[:40]
    assert residuals[0] < 1e-6
    assert change <= np.linalg.norm(slope) / block_of(SETUP.samples) * (1 + 1e-6)
    assert change > 0


@pytest.mark.usefixtures("any_delay_shows")
def test_a_gain_that_a_delay_would_explain_is_not_accepted_from_the_network() -> None:
    def of_gain(gain: float) -> tuple[Array, Recording]:
        faults = Faults(friction=0.3, gain=gain)
        whole = simulate(THESIS, Chirp(), faults=faults, noise=0.05, adc_bits=12)
        kept = Recording({name: whole[name] for name in ("time_s", "command_rad", *BOTH)})
        return SETUP.space.points(faults.vector), kept

    near, recording = of_gain(0.46)
    reasons = answer_alone(constant_estimator(SETUP, near, 2e-3), recording, THESIS)
    assert isinstance(reasons, tuple)
    assert "its gain may be a delay: a delay of 0.23 ms" in reasons[0]
    far, recording = of_gain(0.4)
    assert (
        diagnose_by(constant_estimator(SETUP, far, 2e-3), recording, THESIS, fast=True).method == "estimator"
    )
