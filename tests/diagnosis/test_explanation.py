"""Conditions of an explained recording: small residuals, plausible nuisances, consistent sensors."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cases import HEALTHY, THESIS, USUAL
from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.law_sections import Friction
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.actuator.unit.baseline import Baseline
from emaphm.arrays import Array
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.diagnosis.explanation.known_values import contradicted_values
from emaphm.diagnosis.explanation.load_friction import load_may_be_friction
from emaphm.diagnosis.explanation.motion import moves_at
from emaphm.diagnosis.explanation.one_value import idle_channels
from emaphm.diagnosis.explanation.reasons import reasons_against
from emaphm.diagnosis.explanation.residuals import is_drowned
from emaphm.diagnosis.explanation.sensor_scores import SensorScore, sensor_scores, shift_by_delay
from emaphm.diagnosis.explanation.unseen_inertia import unseen_inertia
from emaphm.diagnosis.verdict import estimates
from emaphm.estimation.discrepancy import Discrepancy
from emaphm.estimation.global_search.multistart import local_search
from emaphm.estimation.objective import MapObjective, faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.nuisances import COPPER, MAGNETS, NuisanceSet, with_wider_priors
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.estimation.space.parameter_variation import sizes
from emaphm.estimation.uncertainty.local_covariance import jacobians_at
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

DQ = ("current_d_A", "current_q_A", "voltage_d_V", "voltage_q_V", "angle_rad")
CHANNELS = ("current_A", "voltage_V", "position_rad", "speed_rad_s")
WHOLE = simulate(THESIS, Chirp(), model="averaged", noise=0.05, duration=0.3)
COLUMNS = {name: WHOLE[name] for name in ("time_s", "command_rad", *CHANNELS)}


def at_the_truth(columns: Mapping[str, Array]) -> SearchResult:
    """Return the healthy estimate of a recording of the averaged model, marked as corrected."""
    recording = Recording({**COLUMNS, **columns})
    objective = faults_objective(problem_of(recording, THESIS, channels=None), None)
    result = SearchResult.at(objective, objective.space.points(HEALTHY))
    # Weighted by its residuals, like the result of a search.
    result = result.reweighted()
    return replace(result, correction=np.full_like(result.correction, 1e-12))


def reasons(result: SearchResult) -> str:
    jacobians = jacobians_at(result.objective, result.point, np.random.default_rng(0))
    return "; ".join(reasons_against(result, jacobians, {}, 0, moves=True))


def test_a_recording_of_the_model_itself_is_explained() -> None:
    assert reasons(at_the_truth({})) == ""


@pytest.mark.parametrize(
    ("name", "spoilt", "said"),
    [
        ("current_A", np.random.default_rng(0).normal(0, 3, WHOLE.samples), "does not resemble"),
        ("voltage_V", -WHOLE["voltage_V"], "voltage_V: the model does not resemble it"),
        ("speed_rad_s", 1.2 * WHOLE["speed_rad_s"], "speed_rad_s: the residual"),
        ("position_rad", np.full(WHOLE.samples, 1e-3), "position_rad shows 0.001 throughout"),
    ],
)
def test_a_spoilt_channel_is_named(name: str, spoilt: Array, said: str) -> None:
    assert said in reasons(at_the_truth({name: spoilt}))


@pytest.mark.parametrize("about", [0.0, 0.5])
@pytest.mark.parametrize("scale", [-1.0, 0.5])
def test_a_position_with_another_motion_is_named_about_any_position(about: float, scale: float) -> None:
    whole = simulate(THESIS, Chirp(about=about), model="averaged", noise=0.05, duration=0.3)
    columns = {name: whole[name] for name in ("command_rad", *CHANNELS)}
    assert reasons(at_the_truth(columns)) == ""
    shown = columns | {"position_rad": about + scale * (whole["position_rad"] - about)}
    assert "position_rad: the model does not resemble it" in reasons(at_the_truth(shown))


@given(signal=st.floats(0, 1), seed=st.integers(0, 99))
def test_a_signal_of_the_model_may_be_drowned_in_noise(signal: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    modelled, noise = signal * rng.normal(size=4000), rng.normal(size=4000)
    assert is_drowned("current_d_A", modelled + noise, noise)
    # Noise that does not contain the signal of the model.
    if signal > 0.2:
        assert not is_drowned("voltage_V", noise, noise - modelled)
        assert not is_drowned("voltage_V", noise - modelled, noise - 2 * modelled)


def test_a_recorded_current_along_the_flux_controlled_to_0_is_explained() -> None:
    pmsm = Actuator.pmsm()
    command, faults = Chirp(duration=0.25), Faults(friction=0.3)
    whole = simulate(pmsm, command, faults=faults, duration=0.25, noise=0.05, adc_bits=12)
    diagnosis = diagnose(Recording({name: whole[name] for name in ("time_s", "command_rad", *DQ)}), pmsm)
    assert diagnosis.explained
    assert diagnosis.components["friction"].verdict == "degraded"
    assert not any("rotor_zero" in note for note in diagnosis.recording_notes)


CALIBRATED = THESIS.model_copy(update={"baseline": Baseline.of(("coulomb",), np.array([[1e-4]]), ("a.csv",))})
LOADED = THESIS.model_copy(
    update={
        "baseline": Baseline.of(("coulomb",), np.array([[1e-4]]), ("a.csv", "b.csv"), (-0.35, 0.1)),
    }
)
GREASED = CALIBRATED.model_copy(update={"friction": Friction(load_friction=0.05)})


def load_notes(actuator: Actuator, friction: float, load: float) -> Sequence[str]:
    """Return the notes on friction that the load may cause, for these estimates of both."""
    objective = faults_objective(problem_of(Recording(COLUMNS), actuator, channels=None), None)
    space = objective.space
    point = space.points(Faults(friction=friction).vector)
    point[space.coordinates.index("load")] = load / space.nuisances.meaning[0, 0]
    components = estimates(space, point, 1e-8 * np.eye(space.dimensions), ())
    return load_may_be_friction(components, SearchResult.at(objective, point))


@pytest.mark.parametrize("load", [0.3, -0.3])
def test_friction_that_the_load_may_cause_has_a_note(load: float) -> None:
    (note,) = load_notes(CALIBRATED, 0.1, load)
    # A friction of 0.1 is 20 % more dry friction of motor and user.
    share = 100 * 0.2 * THESIS.mechanics.dynamic_friction / 0.3
    assert f"friction that is {share:.2g} % of the load" in note


@pytest.mark.parametrize(
    ("actuator", "friction", "load"),
    [
        (CALIBRATED, 0.7, 0.3),
        (CALIBRATED, -0.1, 0.3),
        (CALIBRATED, 0.1, 0.05),
        (THESIS, 0.1, 0.3),
        (GREASED, 0.1, 0.3),
        (LOADED, 0.1, 0.3),
    ],
)
def test_friction_that_the_load_cannot_cause_has_no_note(
    actuator: Actuator, friction: float, load: float
) -> None:
    assert len(load_notes(actuator, friction, load)) == 0


def test_a_channel_that_is_zero_throughout_has_a_note() -> None:
    assert idle_channels(at_the_truth({}).objective.problem) == ()
    idle = at_the_truth({"voltage_V": np.zeros(WHOLE.samples)}).objective.problem
    (note,) = idle_channels(idle)
    assert note.startswith("voltage_V is 0 throughout and is not compared")


def test_an_unidentifiable_deviation_of_inertia_has_a_note() -> None:
    def notes_for(channels: tuple[str, ...], nuisances: tuple[str, ...] | None = None) -> tuple[str, ...]:
        recording = Recording({name: COLUMNS[name] for name in ("time_s", "command_rad", *channels)})
        return unseen_inertia(faults_objective(problem_of(recording, THESIS, channels=None), nuisances))

    (note,) = notes_for(CHANNELS[:1])
    assert "from current_A alone, a deviation of 5 % appears as faults" in note
    assert (
        notes_for(CHANNELS[:1], ("load", "inertia"))
        == notes_for(CHANNELS[:1], ())
        == notes_for(CHANNELS[:2])
        == ()
    )


def test_spikes_are_not_accepted_as_noise() -> None:
    current = WHOLE["current_A"].copy()
    current[[100, 400, 700, 900, 1200]] = 22.0
    assert "current_A: the residual" in reasons(at_the_truth({"current_A": current}))


def test_switching_absent_from_the_recording_does_not_account_for_a_residual() -> None:
    result = at_the_truth({"current_A": 1.3 * WHOLE["current_A"]})
    # A chaotic model: half of the current is switching, and the residual is a third of the variance of this.
    switching = float(np.mean(WHOLE["current_A"] ** 2)) / 4
    none = np.zeros_like(result.correction)
    chaotic = Discrepancy(none, none, switching, runs=16, slow_variance=switching)
    assert result.residual_variance < switching
    assert "current_A: the residual of 23" in reasons(replace(result, discrepancy=chaotic))


def test_phase_currents_that_do_not_add_up_to_zero_are_named() -> None:
    phases = {
        f"current_{p}_A": np.sin(np.arange(WHOLE.samples) / 20 - k * 2.0944) for k, p in enumerate("abc")
    }
    assert "add up" not in reasons(at_the_truth(phases))
    spoilt = {**phases, "current_a_A": 1.2 * phases["current_a_A"]}
    assert "the scale of one of them or its sign is wrong" in reasons(at_the_truth(spoilt))
    # A constant sum is a zero error; with a wrong scale, the rest of the sum is large.
    zero = {**phases, "current_b_A": phases["current_b_A"] - 0.3}
    assert "add up to a constant -0.3 A, and not to 0: a zero error" in reasons(at_the_truth(zero))
    scale_and_zero = {**spoilt, "current_b_A": zero["current_b_A"]}
    assert "zero error" not in reasons(at_the_truth(scale_and_zero))


def test_a_temperature_far_from_its_prior_is_a_reason_against() -> None:
    result = at_the_truth({})
    point = result.point.copy()
    # A unit of the coordinate is five standard deviations of its prior.
    point[result.objective.space.coordinates.index("temperature")] = -4 / 5
    reason = reasons(replace(result, point=point, known_outputs=None))
    assert "temperature: the estimate of -120 K is 4.0 standard deviations" in reason


DEVIATIONS = {"viscous": 0.05, "offset": 1e-3}
"""Standard errors of a calibration: of the logarithm, and in N·m."""


def reasons_off_calibration(name: str, far: float) -> str:
    """Return the reasons against an estimate `far` standard errors from its calibrated value."""
    deviation = DEVIATIONS[name]
    known = np.diag([deviation**2, 0.05**2])
    baseline = Baseline.of((name, "inertia"), known, ("healthy.csv",))
    calibrated = THESIS.model_copy(update={"baseline": baseline})
    described, off = lumped_parameters(THESIS, (name,))[name], far * deviation
    value = described + off if name == "offset" else described * np.exp(off)
    unit = with_lumped_parameters(THESIS, {name: value})
    whole = simulate(unit, Chirp(), model="averaged", noise=0.05, duration=0.3)
    recording = Recording({column: whole[column] for column in ("time_s", "command_rad", *CHANNELS)})
    objective = faults_objective(problem_of(recording, calibrated, channels=None), ())
    point = objective.space.points(HEALTHY)
    size = sizes(calibrated, (name,))[0]
    point[objective.space.coordinates.index(f"baseline {name}")] = off / size
    result = SearchResult.at(objective, point).reweighted()
    return reasons(replace(result, correction=np.full_like(result.correction, 1e-12)))


@pytest.mark.parametrize("far", [3.5, -3.5])
@pytest.mark.parametrize("name", DEVIATIONS)
def test_a_unit_far_from_its_calibration_is_not_explained(name: str, far: float) -> None:
    off = far * DEVIATIONS[name]
    shown = {"viscous": f"{100 * np.expm1(off):+.3g} %", "offset": f"{off:+.3g} N·m"}[name]
    expected = f"the estimate is {shown} off its calibrated value, 3.5 standard errors of the calibration"
    assert f"{name}: {expected}" in reasons_off_calibration(name, far)


@pytest.mark.parametrize("name", DEVIATIONS)
def test_a_unit_near_its_calibration_is_explained(name: str) -> None:
    assert reasons_off_calibration(name, 2.5) == ""


@pytest.mark.parametrize("scaled", [("voltage_V",), ("voltage_V", "speed_rad_s")])
def test_a_wrong_scale_is_plausible_for_one_sensor_and_not_for_two(scaled: tuple[str, ...]) -> None:
    columns = {name: 1.1 * COLUMNS[name] for name in scaled}
    names = ("load", "temperature", "voltage_scale", "speed_scale")
    recording = Recording({**COLUMNS, **columns})
    objective = faults_objective(problem_of(recording, THESIS, channels=None), names)
    start = objective.space.points(HEALTHY)
    point = start.copy()
    # A unit of the coordinate is five standard deviations of 1 %.
    for channel in scaled:
        point[objective.space.coordinates.index(f"{channel.split('_')[0]}_scale")] = 10 / 5
    result = SearchResult.at(objective, point).reweighted()
    listed_reasons = reasons(replace(result, correction=np.full_like(result.correction, 1e-12)))
    expected = "several sensors seem to have another scale at once (voltage_scale +10 %, speed_scale +10 %)"
    assert (expected in listed_reasons) == (len(scaled) == 2)
    assert bool(listed_reasons) == (len(scaled) == 2)


def test_two_reversed_sensors_are_reported_as_reversed() -> None:
    columns = {name: -COLUMNS[name] for name in ("voltage_V", "speed_rad_s")}
    objective = faults_objective(
        problem_of(Recording({**COLUMNS, **columns}), THESIS, channels=None), ("voltage_scale", "speed_scale")
    )
    point = objective.space.points(HEALTHY)
    # A unit of the coordinate is five standard deviations of 1 %.
    point[-2:] = -200 / 5
    result = SearchResult.at(objective, point).reweighted()
    listed_reasons = reasons(replace(result, correction=np.full_like(result.correction, 1e-12)))
    assert "voltage and speed are reversed; correct their wires" in listed_reasons


@pytest.mark.parametrize("kind", ["delay", "scale", "offset"])
def test_the_score_of_a_sensor_error_is_its_size(kind: str) -> None:
    result = at_the_truth({})
    problem = result.objective.problem
    jacobians = jacobians_at(result.objective, result.point, np.random.default_rng(0))
    exact = dict(zip(problem.channels, problem.predict(HEALTHY)[0], strict=True))
    current = exact["current_A"]
    size, added = {
        "delay": (1e-5, -np.gradient(current, problem.inputs.interval)),
        "scale": (1e-3, current),
        "offset": (1e-3, np.full(current.size, np.sqrt(np.mean(current**2)))),
    }[kind]
    measured = {**problem.measured, **exact, "current_A": current + size * added}
    objective = replace(result.objective, problem=replace(problem, measured=measured))
    with_error = SearchResult.at(objective, result.point)
    scores = {(score.kind, score.channel): score for score in sensor_scores(with_error, jacobians)}
    assert scores[kind, "current_A"].size == pytest.approx(size, rel=1e-3)


def test_a_delay_acts_like_a_lower_gain() -> None:
    result = at_the_truth({})
    jacobians = jacobians_at(result.objective, result.point, np.random.default_rng(0))
    gain = result.objective.space.coordinates.index("gain")
    late, early = (shift_by_delay(result, jacobians, delay)[gain] for delay in (2e-4, -2e-4))
    assert late < 0 < early
    assert late == pytest.approx(-early)


def test_an_error_within_rounding_is_not_suspected() -> None:
    assert SensorScore("scale", "position_rad", 0.11, 0.02).is_suspect()
    assert not SensorScore("scale", "position_rad", 0.11, 0.02, rounding=0.2).is_suspect()
    assert not SensorScore("scale", "position_rad", 0.01, 0.001).is_suspect()


def test_an_early_channel_is_reported_with_its_correction_in_the_description() -> None:
    sentence = str(SensorScore("delay", "voltage_V", -7.5e-5, 1e-6))
    assert "some 0.075 ms early" in sentence
    assert "state delay_s = -7.5e-05 for it under [channels]" in sentence
    assert "[channels]" not in str(
        SensorScore("delay", "", -7.5e-5, 1e-6)
    )  # all channels: an error of the command


def diagnosed(
    late: int,
    faults: Faults = Faults(short_b=0.2),  # noqa: B008 - frozen
    nuisances: tuple[str, ...] | None = None,
    duration: float = 0.2,
    **known: float,
) -> Diagnosis:
    whole = simulate(
        THESIS, Chirp(duration=duration), faults=faults, duration=duration, noise=0.05, adc_bits=12
    )
    rows = np.clip(np.arange(whole.samples) - late, 0, whole.samples - 1)
    columns = {name: whole[name] for name in ("time_s", "command_rad")}
    columns |= {name: whole[name][rows] for name in CHANNELS[:2]}
    columns |= {name: np.full(whole.samples, value) for name, value in known.items()}
    return diagnose(Recording(columns), THESIS, nuisances=nuisances)


@pytest.mark.usefixtures("one_search")
def test_the_true_temperature_is_accepted_and_a_wrong_one_contradicted() -> None:
    nominal = THESIS.electrical.temperature if THESIS.electrical else 0.0
    # Named nuisances: only the search is tested; nothing else is tried after it.
    right = diagnosed(0, nuisances=("load",), temperature_K=nominal)
    assert right.explained
    assert right.reasons == ()
    wrong = diagnosed(0, nuisances=("load",), temperature_K=200.0)
    assert not wrong.explained
    assert any("temperature" in reason for reason in wrong.reasons)
    assert {component.verdict for component in wrong.components.values()} == {"cannot tell"}
    assert wrong.to_dict()["reasons"] == list(wrong.reasons)
    assert all(f"Not explained: {reason}." in str(wrong) for reason in wrong.reasons)


def test_a_wrong_temperature_is_contradicted_with_another_wrong_sensor() -> None:
    cold = lumped_parameters(THESIS, ("resistance", "torque_constant"))
    hot = {
        "resistance": cold["resistance"] * (1 + COPPER * 40),
        "torque_constant": cold["torque_constant"] * (1 + MAGNETS * 40),
    }
    unit = with_lumped_parameters(THESIS, hot)
    whole = simulate(unit, Chirp(), model="averaged", noise=0.05, duration=0.3)
    columns = {name: whole[name] for name in ("time_s", "command_rad", *CHANNELS[:3])}
    assert THESIS.electrical is not None
    columns["position_rad"] = 1.15 * columns["position_rad"]
    columns["temperature_K"] = np.full(whole.samples, THESIS.electrical.temperature)
    problem = problem_of(Recording(columns), THESIS, channels=None)
    # The prior is as wide as after selection of the scale.
    wide = with_wider_priors(THESIS, {"position_scale": 250.0})
    nuisances = NuisanceSet.of(wide, ("load", "position_scale"), tuple(columns))
    objective = MapObjective.of(problem, ParameterSpace.of(THESIS, nuisances))
    start = objective.space.points(HEALTHY)
    start[objective.space.coordinates.index("position_scale")] = 0.15 / nuisances.meaning[1, 1]
    none = np.zeros_like(objective.target)
    point = local_search(objective, start, none, np.random.default_rng(0)).best
    (said,) = contradicted_values(SearchResult.at(objective, point), seed=0)
    assert "the temperature estimated from the other channels differs by +" in said


def test_a_constant_current_is_named() -> None:
    dead = at_the_truth({"current_A": np.ones(WHOLE.samples)})
    assert "current_A shows 1 throughout, while the actuator moves" in reasons(dead)


@pytest.mark.parametrize(
    ("command", "position", "moved"),
    [
        (np.full(500, 5e-3), 5e-3 + np.random.default_rng(0).normal(0, 1e-6, 500), False),
        (np.full(500, 5e-3), 5e-3 + 1e-5 * (np.random.default_rng(1).random(500) < 0.3), False),
        (np.full(500, 5e-3), 5e-3 * (1 - np.exp(-np.arange(500) / 30)), True),
        (np.sin(0.9 * np.arange(60)), 0.8 * np.sin(0.9 * np.arange(60) - 0.3), True),
        (np.sin(0.01 * np.arange(500)), np.zeros(500), False),
    ],
    ids=["noise", "counts", "a step at the start", "slow rows", "jammed"],
)
def test_noise_and_counts_are_no_motion(command: Array, position: Array, moved: bool) -> None:
    columns = {"time_s": np.arange(command.size) / 100, "command_rad": command}
    columns |= {"current_A": np.sin(np.arange(command.size)), "position_rad": position}
    objective = faults_objective(problem_of(Recording(columns), THESIS), ())
    assert moves_at(objective, objective.space.points(HEALTHY)) is moved


@pytest.mark.usefixtures("one_search")
@pytest.mark.evidence
@pytest.mark.parametrize("late", [-1, 1])
def test_a_delay_of_one_row_is_not_called_a_degraded_gain(late: int) -> None:
    assert diagnosed(late, nuisances=USUAL).components["gain"].verdict != "degraded"


@pytest.mark.usefixtures("one_search")
def test_a_delay_of_one_row_widens_the_interval_of_a_degraded_gain() -> None:
    faults = Faults(friction=0.03, gain=0.66)
    in_time, late = (diagnosed(rows, faults, USUAL, 0.3).components["gain"] for rows in (0, 1))
    assert in_time.verdict == "degraded"
    assert in_time.interval95[1] - in_time.interval95[0] < 0.01
    assert late.verdict == "degraded"  # with the delay and without
    # A row at 5 kHz changes this gain by 0.05; the alternative is as uncertain as the estimate.
    assert late.value < 0.62
    assert late.interval95[1] == pytest.approx(0.66, abs=0.005)
