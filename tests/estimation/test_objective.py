"""The objective: rows of channels and priors, weighted by the size of their residuals."""

from dataclasses import replace

import numpy as np
import pytest

from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.diagnosis import Diagnosis, diagnose, error_percent
from emaphm.errors import MethodError
from emaphm.estimation.objective import MapObjective, faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.nuisances import COPPER, MAGNETS, NAMES, PRIORS_PER_UNIT, NuisanceSet
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate
from emaphm.simulation import AVERAGED, REFERENCE

THESIS = Actuator.thesis()
USUAL = THESIS.nuisances.estimated
DURATION = 0.25
TRUTH = Faults(0.3, 0.4, 0.1, 0.25, 0.2, 0.35, 0.7, 0.4)
ROWS = 1250
CHANNELS = ("current_A", "voltage_V", "position_rad", "speed_rad_s")


def rig(load: float = 0.0, temperature_rise_K: float = 0.0, *channels: str, **more: float) -> Recording:
    nominal = lumped_parameters(THESIS, ("resistance", "torque_constant"))
    actuator = with_lumped_parameters(
        THESIS,
        {
            "offset": load,
            "resistance": nominal["resistance"] * (1 + COPPER * temperature_rise_K),
            "torque_constant": nominal["torque_constant"] * (1 + MAGNETS * temperature_rise_K),
        },
    )
    command = Chirp(duration=DURATION)
    whole = simulate(actuator, command, duration=DURATION, faults=TRUTH, noise=0.05, adc_bits=12)
    rows = {name: whole[name] for name in ("time_s", "command_rad", *channels)}
    return Recording(rows | {name: np.full(whole.samples, value) for name, value in more.items()})


def fit(nuisances: tuple[str, ...] = ("load", "current_offset", "current_scale")) -> MapObjective:
    return faults_objective(problem_of(rig(0.0, 0.0, *CHANNELS), THESIS, channels=None), nuisances)


def test_outputs_are_the_rows_of_channels_followed_by_priors() -> None:
    objective = fit()
    point = objective.space.points(TRUTH.vector)[np.newaxis]
    point[0, -3:] = (0.1, -0.2, 0.3)
    rows = objective.outputs(point)
    assert objective.problem.channels == CHANNELS
    assert rows.shape == (1, 4 * ROWS + 3)
    assert objective.target.shape == (4 * ROWS + 3,)
    np.testing.assert_array_equal(objective.target[-3:], 0.0)
    # A prior standard deviation has the weight `prior_weight`; a coordinate of 1 is PRIORS_PER_UNIT of them.
    np.testing.assert_allclose(rows[0, -3:], objective.prior_weight * PRIORS_PER_UNIT * point[0, -3:])
    np.testing.assert_array_equal(objective.target[:ROWS], objective.problem.recorded)


def test_offset_and_scale_of_the_current_sensor_act_only_on_the_current() -> None:
    objective = fit(("current_offset", "current_scale"))
    plain = objective.space.points(TRUTH.vector)[np.newaxis]
    shifted = plain.copy()
    shifted[0, -2:] = (0.2, 0.1)
    # In units of PRIORS_PER_UNIT prior deviations: 0.2 × 5 × 0.045 A, and 0.1 × 5 × 1 %.
    expected = objective.outputs(plain)[0, :ROWS] * 1.005 + 0.045
    np.testing.assert_allclose(objective.outputs(shifted)[0, :ROWS], expected, rtol=1e-12)
    np.testing.assert_array_equal(
        objective.outputs(shifted)[0, ROWS : 4 * ROWS], objective.outputs(plain)[0, ROWS : 4 * ROWS]
    )


def test_a_channel_with_a_larger_residual_has_less_weight() -> None:
    objective = fit(("load",))
    residual = np.ones(4 * ROWS + 1)
    residual[ROWS : 2 * ROWS] = 4.0
    reweighted = objective.reweighted(residual)
    ratios = reweighted.problem.weights / objective.problem.weights
    np.testing.assert_allclose(ratios / ratios[0], [1.0, 0.25, 1.0, 1.0])
    rows = np.random.default_rng(0).normal(size=4 * ROWS + 1)
    np.testing.assert_allclose(
        objective.rescaled(reweighted.rescaled(rows, objective), reweighted), rows, rtol=1e-12
    )
    np.testing.assert_allclose(
        reweighted.rescaled(objective.target, objective), reweighted.target, rtol=1e-12
    )


@pytest.mark.parametrize(("biased", "count"), [(False, 1), (True, 20)])
def test_a_prior_counts_as_one_row_of_a_white_residual_and_as_20_of_a_biased_one(
    biased: bool, count: int
) -> None:
    objective = fit(("load", "temperature"))
    residual = np.random.default_rng(0).normal(size=4 * ROWS + 2)
    reweighted = objective.reweighted(residual, biased=biased)
    point = reweighted.space.points(Faults().vector)[np.newaxis]
    # One prior standard deviation of each nuisance.
    point[0, -2:] = 1 / PRIORS_PER_UNIT
    added = reweighted.outputs(point)[0, -2:] ** 2
    np.testing.assert_allclose(added, count * np.mean(reweighted.rescaled(residual, objective)[:ROWS] ** 2))


def test_nuisances_are_selected_by_default_or_by_name_unless_recorded() -> None:
    assert NuisanceSet.of(THESIS, None, ()).names == ("load", "temperature")
    assert NuisanceSet.of(THESIS, None, ("load_Nm",)).names == ("temperature",)
    assert NuisanceSet.of(THESIS, None, ("temperature_K",)).names == ("load",)
    assert NuisanceSet.of(THESIS, ("inertia", "supply", "inertia"), ()).names == ("inertia", "supply")
    ideal = THESIS.model_copy(update={"electrical": None})
    assert NuisanceSet.of(ideal, None, ()).names == ("load",)
    with pytest.raises(MethodError, match=r"'temperature' needs an \[electrical\] section"):
        NuisanceSet.of(ideal, ("temperature",), ())
    with pytest.raises(MethodError, match=r"unknown nuisance 'tempreature' \(did you mean 'temperature'\?\)"):
        NuisanceSet.of(THESIS, ("tempreature",), ())
    assert set(NAMES) > {"load", "hinge", "temperature", "supply", "inertia"}


def test_a_channel_that_is_zero_throughout_is_not_compared() -> None:
    recording = rig(0.0, 0.0, "current_A", voltage_V=0.0)
    assert problem_of(recording, THESIS, channels=None).channels == ("current_A",)


@pytest.fixture(scope="module")
def loaded_and_hot() -> Recording:
    """Return current and voltage of a unit under a load, 40 K above its nominal temperature."""
    return rig(0.15, 40.0, "current_A", "voltage_V")


@pytest.fixture(scope="module")
def with_voltage(loaded_and_hot: Recording) -> Diagnosis:
    return diagnose(loaded_and_hot, THESIS, nuisances=USUAL)


@pytest.mark.usefixtures("one_search")
def test_current_and_voltage_separate_load_and_heat_from_faults(
    loaded_and_hot: Recording, with_voltage: Diagnosis
) -> None:
    # Bounds for random cases: 2 % in the median, 6 % for 95 of 100.
    assert error_percent(TRUTH.vector, with_voltage.faults.vector) <= 6.0
    assert with_voltage.nuisances["load"].value == pytest.approx(0.15, abs=0.01)
    assert with_voltage.nuisances["temperature"].value == pytest.approx(40.0, abs=5.0)
    without_nuisances = diagnose(loaded_and_hot, THESIS, nuisances=())
    # A tenth of the torque limit is more than all friction: an unknown load of this size biases the faults.
    assert error_percent(TRUTH.vector, without_nuisances.faults.vector) > 10.0
    assert not without_nuisances.explained


def test_without_the_voltage_the_errors_of_shorts_include_the_unknown_heat(with_voltage: Diagnosis) -> None:
    diagnosis = diagnose(rig(0.0, 40.0, "current_A"), THESIS, nuisances=USUAL)
    for name in ("short_a", "short_b", "short_c"):
        low, high = diagnosis.interval[name]
        # 40 K are 1.3 prior standard deviations, within 1.96 of them.
        assert low <= getattr(TRUTH, name) <= high
        wide, narrow = (result.components[name].standard_error for result in (diagnosis, with_voltage))
        assert wide > 2 * narrow


def test_a_recorded_temperature_is_no_nuisance() -> None:
    hot = rig(0.0, 40.0, "current_A", temperature_K=293.15 + 40.0)
    diagnosis = diagnose(hot, THESIS, nuisances=USUAL)
    assert list(diagnosis.nuisances) == ["load"]
    # The bound of a random fault vector at nominal temperature.
    assert error_percent(TRUTH.vector, diagnosis.faults.vector) <= 2.5


def test_a_description_keeps_its_priors_in_a_round_trip() -> None:
    described = replace_priors(load=0.02, estimated=("load", "supply"))
    again = Actuator.from_dict(described.model_dump())
    assert again.nuisances.load == 0.02
    assert NuisanceSet.of(again, None, ()).names == ("load", "supply")
    np.testing.assert_allclose(NuisanceSet.of(again, ("load",), ()).prior_deviations, [0.02])


def replace_priors(**priors: object) -> Actuator:
    nuisances = THESIS.nuisances.model_copy(update=priors)
    return THESIS.model_copy(update={"nuisances": nuisances})


def test_the_weight_of_a_channel_is_the_inverse_of_its_residual() -> None:
    problem = fit(("load",)).problem.weighted([2.0, 1.0, 4.0, 8.0])
    np.testing.assert_allclose(problem.weights, [1.0, 2.0, 0.5, 0.25])
    assert replace(problem).channels == CHANNELS


def test_another_model_changes_the_rows_of_channels_and_not_those_of_priors() -> None:
    objective = fit(("load", "temperature", "current_scale"))
    point = objective.space.points(TRUTH.vector)[np.newaxis]
    point[0, -3:] = (0.1, -0.2, 0.3)
    rows = objective.outputs(point)[0]
    averaged, reference = (
        replace(objective, problem=objective.problem.by(model)) for model in (AVERAGED, REFERENCE)
    )
    np.testing.assert_array_equal(averaged.outputs(point)[0], rows)
    difference = reference.outputs(point)[0] - rows
    assert np.all(np.sqrt(np.mean(difference[: objective.channel_rows].reshape(4, -1) ** 2, axis=1)) > 0)
    np.testing.assert_array_equal(difference[objective.channel_rows :], 0.0)


def test_the_weight_of_a_channel_without_residual_is_limited() -> None:
    objective = fit(("load",))
    residual = np.ones(4 * ROWS + 1) * 0.1
    residual[ROWS : 2 * ROWS] = 0.0
    weights = objective.reweighted(residual).problem.weights
    # No residual counts as smaller than a ten-thousandth of its channel.
    voltage = np.sqrt(np.mean(objective.problem.measured["voltage_V"] ** 2))
    assert weights[1] == pytest.approx(0.1 / (1e-4 * voltage))


def test_a_deviation_from_a_prior_counts_as_twenty_rows_of_the_residual() -> None:
    objective = fit(("load",)).scale_prior(0.5)
    point = objective.space.points(TRUTH.vector)[np.newaxis]
    point[0, -1] = 1 / PRIORS_PER_UNIT
    # A deviation of one standard deviation counts as a residual of 0.5 A in each of 20 rows.
    assert objective.outputs(point)[0, -1] ** 2 == pytest.approx(20 * 0.5**2)


@pytest.mark.parametrize("share", [0.3, 0.5])
def test_rows_that_are_not_compared_do_not_lower_the_normalised_residual(share: float) -> None:
    noise = 0.05
    described = THESIS.model_dump() | {"sensors": {"current_A": {"noise": noise}}}
    actuator = Actuator.from_dict(described)
    problem = problem_of(simulate(actuator, Chirp(), model="averaged", noise=noise), actuator, channels=())
    objective = faults_objective(problem, ())
    point = objective.space.points(Faults().vector[np.newaxis])[0]
    of_all_rows = SearchResult.at(objective, point)
    rows = np.arange(problem.samples) < share * problem.samples
    without_rows = SearchResult.at(objective.ignoring({"current_A": rows}), point)
    # Twice the described variance. From at least 1,250 rows, the size of white noise is known to 2 %;
    # the limit includes a small share of the signal.
    assert of_all_rows.normalised_residual == pytest.approx(2**0.5, rel=0.07)
    assert without_rows.normalised_residual == pytest.approx(of_all_rows.normalised_residual, rel=0.07)
    assert not without_rows.residual_is_expected
