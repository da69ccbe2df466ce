"""A load that steps during a recording: estimated with the faults, which it does not bias."""

from itertools import combinations
from typing import Any

import numpy as np
import pytest

from cases import THESIS, covered
from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.laws import LAWS
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.diagnosis.posing import objective_for
from emaphm.diagnosis.selection.load_steps import best_set
from emaphm.diagnosis.selection.selection import Selection
from emaphm.diagnosis.selection.varying_load import LOAD_STEP, LOADS, with_varying_load
from emaphm.errors import MethodError
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.methods import method_named
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.estimation.space.nuisances import HINGE
from emaphm.plotting.external_load import draw_external_load
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate
from emaphm.simulation import AVERAGED

pytestmark = pytest.mark.usefixtures("one_search", "unrefined")

DURATION = 0.25
TRUTH = Faults(friction=0.2, short_a=0.1, gain=0.6)


def ramp(time: Any, instant: float, rise: float) -> Any:
    return np.interp(time, [instant - rise / 2, instant + rise / 2], [0.0, 1.0])


def load_on(time: Any) -> Any:
    return 0.03 + 0.1 * ramp(time, 0.15, 8e-3)


def load_on_and_off(time: Any) -> Any:
    return 0.03 - 0.08 * (ramp(time, 0.1, 1e-9) - ramp(time, 0.17, 1e-9))


def swinging_and_stepping(time: Any) -> Any:
    return 0.05 * np.sin(2 * np.pi * 3 * np.asarray(time)) + load_on(time)


def recorded(load: Any, actuator: Actuator = THESIS) -> Recording:
    options: dict[str, Any] = {"duration": DURATION, "noise": 0.05, "adc_bits": 12, "seed": 6}
    whole = simulate(actuator, Chirp(duration=DURATION), faults=TRUTH, load=load, **options)
    return Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")})


@pytest.fixture(scope="module")
def diagnosis(one_search: None, unrefined: None) -> Diagnosis:  # noqa: ARG001 - patches for the diagnosis
    """Return the diagnosis with a load that is not named as a nuisance."""
    return diagnose(recorded(load_on), THESIS, workers=1)


def test_faults_are_estimated_under_a_load_that_steps(diagnosis: Diagnosis) -> None:
    assert diagnosis.explained
    assert (diagnosis.selected, diagnosis.laws) == ((LOAD_STEP,), ())
    assert all(covered(TRUTH.vector, diagnosis))
    degraded = {name for name, one in diagnosis.components.items() if one.verdict == "degraded"}
    assert degraded == {"friction", "short_a", "gain"}


def test_the_step_of_the_load_is_estimated(diagnosis: Diagnosis) -> None:
    load = diagnosis.load
    assert load is not None
    (step,) = load.steps
    assert step.size == pytest.approx(0.1, abs=2e-3)
    assert step.time_s == pytest.approx(0.15, abs=1e-3)
    assert step.rise_s == pytest.approx(8e-3, abs=5e-3)
    rows = diagnosis.time_s + (diagnosis.time_s[1] - diagnosis.time_s[0]) / 2
    error = np.abs(load.value - load_on(rows))
    assert np.max(error / load.standard_error) < 4
    # The instant is uncertain by more than a row, so that the load in the rows about it is more uncertain.
    near_step = np.abs(rows - 0.15) < 10e-3
    assert load.standard_error[near_step].max() > 3 * load.standard_error[~near_step].max()


def test_the_load_is_reported_in_one_line_and_drawn(diagnosis: Diagnosis) -> None:
    (line,) = [line for line in diagnosis.notes() if line.startswith("The load steps by +0.1")]
    assert "load_Nm" in line
    assert not any("load_step" in line for line in diagnosis.notes())
    assert [axis.get_ylabel() for axis in draw_external_load(diagnosis).axes] == ["load [N·m]"]
    described = diagnosis.to_dict()["nuisances"]
    assert described["load_step_1"]["unit"] == "N·m"
    assert described["load_step_1_time"]["unit"] == described["load_step_1_rise"]["unit"] == "s"


@pytest.mark.parametrize(
    ("load", "names", "steps"),
    [
        (load_on_and_off, (LOAD_STEP,), [(-0.08, 0.1), (0.08, 0.17)]),
        (swinging_and_stepping, LOADS, [(0.1, 0.15)]),
    ],
    ids=["a load put on and taken off", "one that swings too"],
)
def test_a_load_has_as_many_parameters_as_required(
    load: Any, names: tuple[str, ...], steps: list[tuple[float, float]]
) -> None:
    loaded = selection_with_load(recorded(load))
    assert loaded is not None
    result = loaded.result
    assert loaded.nuisances == names
    assert result.residual_is_expected
    values = values_of_nuisances(result)
    estimated_steps = [
        (values[f"load_step_{i + 1}"], values[f"load_step_{i + 1}_time"]) for i in range(len(steps))
    ]
    np.testing.assert_allclose(estimated_steps, steps, atol=5e-3)
    faults = result.objective.space.faults(result.point[np.newaxis])[0]
    np.testing.assert_allclose(faults[[0, 2, 7]], TRUTH.vector[[0, 2, 7]], atol=0.03)


def test_a_load_proportional_to_the_position_has_one_parameter() -> None:
    loaded = selection_with_load(recorded(0.03, with_lumped_parameters(THESIS, {"hinge": -16.0})))
    assert loaded is not None
    assert loaded.nuisances == (HINGE,)
    assert loaded.result.residual_is_expected
    assert values_of_nuisances(loaded.result)[HINGE] == pytest.approx(-16.0, abs=0.5)
    faults = loaded.result.objective.space.faults(loaded.result.point[np.newaxis])[0]
    np.testing.assert_allclose(faults[[0, 2, 7]], TRUTH.vector[[0, 2, 7]], atol=0.03)


def test_a_step_of_the_load_cannot_be_requested_as_a_nuisance() -> None:
    with pytest.raises(MethodError, match="unknown nuisance 'load_step_1'"):
        diagnose(recorded(load_on), THESIS, nuisances=("load", "load_step_1"), workers=1)


def test_another_law_of_friction_is_not_read_as_a_varying_load() -> None:
    stribeck = with_lumped_parameters(LAWS["stribeck"].added_to(THESIS), {"stribeck_speed": 20.0})
    assert selection_with_load(recorded(0.03, stribeck)) is None


def test_the_best_instants_have_the_smallest_residual() -> None:
    rng = np.random.default_rng(3)
    columns, residual = rng.normal(size=(6, 40)), rng.normal(size=40)
    columns[5] = 0.0  # a step after the last row
    sets = np.array(list(combinations(range(6), 2)))
    residuals = [
        np.linalg.lstsq(columns[pair].T, residual, rcond=None)[0] @ columns[pair] - residual for pair in sets
    ]
    squares = [float(np.mean(residual_of_pair**2)) for residual_of_pair in residuals]
    best, mean_square = best_set(residual, columns, sets)
    np.testing.assert_array_equal(best, sets[int(np.argmin(squares))])
    assert mean_square == pytest.approx(min(squares), rel=1e-6)


def test_steps_without_effect_do_not_reduce_the_residual() -> None:
    residual = np.ones(40)
    _, mean_square = best_set(residual, np.zeros((6, 40)), np.array(list(combinations(range(6), 2))))
    assert mean_square == 1.0


def selection_with_load(recording: Recording) -> Selection | None:
    """Return the estimate with a varying load, like a diagnosis of an unexplained recording.

    The start is near the true faults: the search for faults is not tested here.
    """
    method = method_named("hybrid")
    objective = objective_for(recording, THESIS, method, AVERAGED, None, 1)
    searched = correct_bias(objective, objective.space.points(TRUTH.vector[np.newaxis]), 4, seed=0)
    assert not searched.residual_is_expected
    return with_varying_load(searched, SearchSettings(method, 10, 0))


def values_of_nuisances(result: SearchResult) -> dict[str, float]:
    values = result.objective.space.nuisance_values(result.point[np.newaxis])
    return {name: float(value[0]) for name, value in values.items()}
