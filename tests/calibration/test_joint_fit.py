"""Joint fits of several recordings: shared parameters, parameters of one recording, and contradictions."""

import json
import re

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp
from emaphm.actuator.laws import LAWS
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.calibration import Calibration, CampaignRow, calibrate
from emaphm.calibration.conditions import common_factor, joint_objective, only_ratios
from emaphm.calibration.unit_fit import within_range
from emaphm.errors import MethodError
from emaphm.estimation.finite_differences import one_sided_jacobians
from emaphm.estimation.space.parameter_variation import ParameterVariation
from emaphm.recording import Recording, acquire
from emaphm.simulated_recording import simulate
from emaphm.simulation import AVERAGED

pytestmark = pytest.mark.usefixtures("no_model_error")

FREE = ("inertia", "viscous", "coulomb")
CHANNELS = ("time_s", "command_rad", "current_A", "position_rad", "voltage_V")
NOISE = {"current_A": 0.1, "position_rad": 2e-5, "voltage_V": 0.3}


def recorded(
    actuator: Actuator,
    seed: int,
    *,
    stop_hz: float = 15.0,
    duration: float = 0.15,
    channels: tuple[str, ...] = CHANNELS,
    load: float = 0.0,
) -> Recording:
    """Return a recording of the averaged model at its steps, of which only the noise is unexplained."""
    with_load = with_lumped_parameters(actuator, {"offset": load})
    whole = simulate(
        with_load,
        Chirp(stop_hz=stop_hz, duration=duration),
        model="averaged",
        sampling="instant",
        sample_rate=1 / AVERAGED.step,
        duration=duration,
    )
    kept = Recording({name: whole[name] for name in channels}, "instant", f"day {seed}")
    return acquire(kept, noise={name: NOISE[name] for name in channels if name in NOISE}, seed=seed)


def fitted(rows: object, free: tuple[str, ...] = FREE, actuator: Actuator = THESIS) -> Calibration:
    return calibrate(rows, actuator, free, nuisances=("load",), max_corrections=0, workers=1)  # type: ignore[arg-type]


def unit(**factors: float) -> Actuator:
    values = lumped_parameters(THESIS, tuple(factors))
    return with_lumped_parameters(
        THESIS, {name: values[name] * f for name, f in factors.items()}, name="unit"
    )


def test_recordings_with_different_lengths_commands_and_channels_are_fitted_jointly() -> None:
    true = unit(inertia=1.9, viscous=0.6, coulomb=0.7)
    days = [
        recorded(true, 1, load=0.05, duration=0.25),
        recorded(true, 2, stop_hz=9.0, channels=CHANNELS[:3], load=-0.03),
        recorded(true, 3, duration=0.2, channels=CHANNELS[:4]),
    ]
    calibration = fitted(days)
    described = lumped_parameters(true, FREE)
    for name, parameter in calibration.parameters.items():
        # In one of 5000 cases, one of three normal deviates exceeds 4.
        assert abs(parameter.value - described[name]) < 4 * parameter.standard_error
        assert (parameter.identifiable, parameter.doubtful, parameter.at_bound) == (True, False, False)
    np.testing.assert_allclose(
        [nuisance["load"] for nuisance in calibration.nuisances], [0.05, -0.03, 0.0], atol=2e-3
    )
    assert len(calibration.replays) == 3
    # Three recordings contain more information than the first alone.
    alone = fitted(days[0])
    assert calibration.parameters["inertia"].standard_error < 1.1 * alone.parameters["inertia"].standard_error


def test_the_normal_equations_are_those_of_the_jacobian_of_all_rows() -> None:
    rows = [CampaignRow(recorded(THESIS, 1)), CampaignRow(recorded(THESIS, 2, duration=0.2))]
    variation = ParameterVariation.free(THESIS, FREE)
    joint = joint_objective(rows, THESIS, variation, ("load", "current_offset"), 1)
    point = np.random.default_rng(0).normal(0.0, 0.05, joint.box.lower.size)
    assert point.size == 3 + 2 + 2
    (evaluation,) = joint.evaluate(point[np.newaxis])
    ((normal, gradient),) = joint.normal_equations([evaluation])

    def residual_rows(points: np.ndarray) -> np.ndarray:
        outcomes = joint.evaluate(points)
        priors = points[:, :3] * (20**0.5 / variation.priors)
        return np.hstack([-np.array([np.concatenate(outcome.residual) for outcome in outcomes]), priors])

    outputs = residual_rows(point[np.newaxis])
    (dense,) = one_sided_jacobians(residual_rows, point[np.newaxis], outputs, joint.box, joint.step)
    np.testing.assert_allclose(normal, dense @ dense.T, rtol=1e-9, atol=1e-9 * np.abs(normal).max())
    np.testing.assert_allclose(gradient, -dense @ outputs[0], rtol=1e-6, atol=1e-9 * np.abs(gradient).max())
    assert evaluation.cost == pytest.approx(float(np.sum(outputs**2)))
    # Parameters of one recording are independent of those of the other.
    assert not np.any(normal[3:5, 5:7])


def test_contradicting_recordings_have_a_doubtful_parameter_with_a_large_error() -> None:
    # Like three logs of a real servo: no common value fits any of them.
    days = [recorded(unit(inertia=f), i) for i, f in enumerate((1.6, 0.35, 1.45))]
    calibration = fitted(days)
    inertia = calibration.parameters["inertia"]
    assert inertia.doubtful
    for factor in (1.6, 0.35, 1.45):
        assert abs(inertia.value - factor * 2.5e-5) < 2 * inertia.standard_error
        assert "the recordings contradict each other: alone they would have" in inertia.reason
    answer = json.loads(calibration.to_json())
    assert answer["parameters"]["inertia"]["doubtful"] is True
    assert answer["parameters"]["inertia"]["reason"] == inertia.reason
    # The reason gives the value of each recording alone.
    values = [float(value) for value in re.findall(r"([\d.e-]+) ±", inertia.reason)]
    np.testing.assert_allclose(values, [f * 2.5e-5 for f in (1.6, 0.35, 1.45)], rtol=0.02)
    assert calibration.birge_ratio is not None
    assert calibration.birge_ratio > 10
    assert max(recording.misfit_ratio or 0.0 for recording in calibration.recordings) > 2
    text = str(calibration)
    assert "inertia is doubtful" in text
    assert "times as well as with the others" in text


def test_recordings_of_one_unit_are_not_doubtful() -> None:
    days = [recorded(THESIS, i, stop_hz=f) for i, f in enumerate((15.0, 11.0, 13.0))]
    assert not any(p.doubtful for p in fitted(days).parameters.values())


def test_a_known_value_applies_only_to_its_recording() -> None:
    gains = (1e5, 4e4)
    days = [recorded(unit(inertia=1.3, position_gain=g / 1e5), i) for i, g in enumerate(gains)]
    rows = [CampaignRow(day, {"position_gain": g}) for day, g in zip(days, gains, strict=True)]
    known, assumed = fitted(rows), fitted(days)
    assert known.parameters["inertia"].value == pytest.approx(1.3 * 2.5e-5, rel=0.01)
    assert known.relative_error["position_rad"] < 0.1 * assumed.relative_error["position_rad"]
    assert [recording.known["position_gain"] for recording in known.recordings] == list(gains)
    # The description of the unit keeps its value.
    assert known.actuator.controller.position_gain == THESIS.controller.position_gain


def test_a_known_load_is_no_nuisance() -> None:
    days = [recorded(THESIS, i, load=load) for i, load in enumerate((0.05, -0.08))]
    rows = [CampaignRow(day, {"load": load}) for day, load in zip(days, (0.05, -0.08), strict=True)]
    calibration = fitted(rows)
    assert calibration.nuisances == ({}, {})
    assert calibration.parameters["coulomb"].value == pytest.approx(
        THESIS.mechanics.dynamic_friction, rel=0.01
    )


def test_a_known_value_may_be_0_or_have_the_opposite_sign() -> None:
    described = with_lumped_parameters(THESIS, {"offset": 0.05})
    loads = (0.0, -0.08)
    days = [recorded(unit(inertia=1.3), i, load=load) for i, load in enumerate(loads)]
    rows = [CampaignRow(day, {"offset": load}) for day, load in zip(days, loads, strict=True)]
    assert fitted(rows, ("inertia",), described).parameters["inertia"].value == pytest.approx(
        1.3 * 2.5e-5, rel=0.01
    )


def test_the_scale_of_torques_is_identifiable_only_with_a_nonzero_load() -> None:
    day = recorded(THESIS, 1, channels=CHANNELS[:4])
    kept = {name: day[name] for name in CHANNELS[:4]}
    for load, is_open in ((0.0, True), (0.1, False)):
        loaded = Recording({**kept, "load_Nm": np.full(kept["time_s"].size, load)}, day.sampling, day.source)
        free = (*FREE, "static", "torque_constant")
        assert only_ratios([CampaignRow(loaded)], THESIS, free) is is_open


def test_a_parameter_may_be_free_for_each_recording() -> None:
    strengths = (0.9, 1.08)
    days = [recorded(unit(torque_constant=f, coulomb=1.2), i) for i, f in enumerate(strengths)]
    calibration = fitted([CampaignRow(day, free=("torque_constant",)) for day in days])
    for recording, factor in zip(calibration.recordings, strengths, strict=True):
        assert recording.own["torque_constant"] == pytest.approx(0.0752 * factor, rel=0.01)
    assert calibration.parameters["coulomb"].value == pytest.approx(
        1.2 * THESIS.mechanics.dynamic_friction, rel=0.01
    )
    # A parameter that is also shared is the mean, and its error includes the difference.
    shared_and_own = fitted(
        [CampaignRow(day, free=("torque_constant",)) for day in days], (*FREE, "torque_constant")
    )
    assert shared_and_own.parameters["torque_constant"].value == pytest.approx(
        0.0752 * np.mean(strengths), rel=0.02
    )
    assert shared_and_own.parameters["torque_constant"].standard_error > 0.05 * 0.0752


def test_a_parameter_at_its_bound_is_reported() -> None:
    # Without viscous friction in the unit, its estimate falls to the bound of the search.
    days = [recorded(with_lumped_parameters(THESIS, {"viscous": 0.0}), i) for i in range(2)]
    guess = with_lumped_parameters(THESIS, {"viscous": 1e-3})
    viscous = fitted(days, actuator=guess).parameters["viscous"]
    assert not viscous.identifiable
    assert viscous.standard_error > viscous.value
    assert viscous.at_bound
    assert "at its bound" in viscous.reason


def test_collinear_parameters_are_named_with_the_channel_that_would_separate_them() -> None:
    # Heat raises the resistance and lowers the torque constant; another motor may differ in the same way.
    calibration = calibrate(
        [recorded(THESIS, i) for i in range(2)],
        THESIS,
        ("coulomb", "torque_constant", "resistance"),
        nuisances=("temperature",),
        max_corrections=0,
        workers=1,
    )
    (group,) = calibration.collinear_sets
    assert set(group.members) == {"torque_constant", "resistance", "temperature"}
    assert group.channels == ("temperature_K",)
    assert "act alike in these recordings" in str(calibration)
    assert "collinear" in next(
        line for line in str(calibration).splitlines() if line.startswith("resistance")
    )
    assert calibration.to_dict()["collinear"][0]["channels"] == ("temperature_K",)


@pytest.mark.parametrize(
    ("known", "free", "message"),
    [
        ({"inertai": 1.0}, (), r"unknown quantity 'inertai' \(did you mean 'inertia'\?\)"),
        ({"position_gian": 1.0}, (), r"did you mean 'position_gain'\?"),
        ({"inertia": 2e-5}, (), "'inertia' is known here, and free for all recordings; leave one"),
        ({"supply": 50.0}, ("supply",), "'supply' is both known and free here; leave one"),
        ({"position_gain": -1e5}, (), "position_gain = -100000 is impossible: .* greater than 0"),
        ({"temperature": -5.0}, (), "give it in kelvin"),
        ({"load": float("nan")}, (), "is no finite number"),
        ({}, ("frction",), "unknown parameter 'frction'"),
    ],
)
def test_contradictory_rows_are_refused(known: dict[str, float], free: tuple[str, ...], message: str) -> None:
    row = CampaignRow(recorded(THESIS, 0), known, free, "campaign.csv, row 2")
    with pytest.raises(MethodError, match=rf"^campaign.csv, row 2: .*{message}") as caught:
        fitted([row])
    assert "\n" not in str(caught.value)


def test_a_load_that_is_recorded_and_given_is_refused() -> None:
    day = recorded(THESIS, 0)
    loaded = Recording({**day.channels, "load_Nm": np.zeros(day.samples)}, day.sampling, "loaded")
    with pytest.raises(MethodError, match="'load' is given, and loaded has the column 'load_Nm'; leave"):
        fitted([CampaignRow(loaded, {"load": 0.1})])


def test_the_parameters_of_bristles_scale_with_the_common_factor_of_all_torques() -> None:
    names = ("inertia", "coulomb", "presliding_stiffness", "presliding_damping", "torque_constant", "supply")
    bristles = LAWS["presliding"].added_to(THESIS)
    effects = common_factor(bristles, names, np.zeros(len(names)))
    assert effects.tolist() == [1.0, 1.0, 1.0, 1.0, 1.0, 0.0]


def test_a_standard_error_is_at_most_the_range_of_the_search() -> None:
    rng = np.random.default_rng(3)
    root = rng.normal(size=(3, 3)) * np.array([[41.0], [0.2], [3.0]])
    covariance, widest = root @ root.T, np.array([3.4, 3.4, 0.1])
    limited = within_range(covariance, widest)
    before, after = np.sqrt(np.diag(covariance)), np.sqrt(np.diag(limited))
    np.testing.assert_allclose(after, np.minimum(before, widest))
    np.testing.assert_allclose(limited / np.outer(after, after), covariance / np.outer(before, before))
