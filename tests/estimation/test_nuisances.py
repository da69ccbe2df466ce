"""Nuisances of a recording: their effect on lumped parameters, their priors and their selection by name."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emaphm.actuator import Actuator, Chirp, Faults, Load, Sine
from emaphm.actuator.laws import law_named
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.arrays import Array
from emaphm.diagnosis import diagnose
from emaphm.errors import ActuatorError, MethodError
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.space.nuisances import (
    LOAD_VARIATION,
    NAMES,
    PRIORS_PER_UNIT,
    Located,
    NuisanceSet,
    unit_of,
)
from emaphm.estimation.space.parameter_variation import ParameterVariation
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

THESIS = Actuator.thesis()
TRUTH = Faults(0.3, 0.4, 0.1, 0.25, 0.2, 0.35, 0.7, 0.4)


def described(**nuisances: object) -> Actuator:
    return Actuator.from_dict(THESIS.model_dump() | {"nuisances": nuisances})


def warmed(kelvin: float) -> dict[str, float]:
    """Return the lumped parameters of the thesis's motor at a temperature rise (copper, NdFeB)."""
    cold = lumped_parameters(THESIS, ("resistance", "torque_constant"))
    return {
        "resistance": cold["resistance"] * (1 + 0.00393 * kelvin),
        "torque_constant": cold["torque_constant"] * (1 - 0.0011 * kelvin),
    }


# Located nuisances.


def test_a_located_nuisance_varies_about_its_value_and_not_about_nominal() -> None:
    located = {"supply": Located(-0.1, 0.01)}
    nuisances = NuisanceSet.of(THESIS, ("load", "supply"), (), located=located)
    points = np.array([[0.0, 0.0], [0.0, 1 / PRIORS_PER_UNIT], nuisances.nominal])
    values = nuisances.values(points)
    np.testing.assert_allclose(values["supply"], [-0.1, -0.09, 0.0], atol=1e-12)
    supply = lumped_parameters(THESIS, ("supply",))["supply"]
    acting = nuisances.lumped_parameters(THESIS, values)["supply"]
    np.testing.assert_allclose(acting, supply * np.array([0.9, 0.91, 1.0]))
    np.testing.assert_allclose(nuisances.prior_deviations[1], 0.01)


# Selection by name.


def test_a_nuisance_named_twice_counts_once() -> None:
    assert NuisanceSet.of(THESIS, ("supply", "load", "supply"), ()).names == ("supply", "load")
    assert NuisanceSet.of(described(estimated=["load", "load"]), None, ()).names == ("load",)
    assert NuisanceSet.of(THESIS, (), ()).names == ()


@pytest.mark.parametrize("name", NAMES)
def test_a_misspelt_nuisance_is_answered_with_the_nearest(name: str) -> None:
    with pytest.raises(MethodError, match=rf"^unknown nuisance '{name}s' \(did you mean '{name}'\?\)$"):
        NuisanceSet.of(THESIS, (f"{name}s",), ())


@pytest.mark.parametrize("name", [name for name in NAMES if name != LOAD_VARIATION])
def test_only_temperature_supply_and_voltage_need_windings(name: str) -> None:
    actuator = described(hinge=1.0)
    ideal = actuator.model_copy(update={"electrical": None})
    assert NuisanceSet.of(actuator, (name,), ()).names == (name,)
    if name in ("temperature", "supply") or name.startswith("voltage"):
        with pytest.raises(MethodError, match=rf"'{name}' needs an \[electrical\] section"):
            NuisanceSet.of(ideal, (name,), ())
    else:
        assert NuisanceSet.of(ideal, (name,), ()).names == (name,)


def test_the_prior_of_a_hinge_is_the_stall_torque_at_the_end_stop_unless_stated() -> None:
    stall = 22.5 * 0.0752 / np.radians(30)
    deviations = NuisanceSet.of(THESIS, ("hinge",), ()).prior_deviations
    np.testing.assert_allclose(deviations, [stall], rtol=1e-3)
    free = Actuator.from_dict(
        {**THESIS.model_dump(), "mechanics": {**THESIS.mechanics.model_dump(), "end_stops": None}}
    )
    message = r"'hinge' is not known; give its standard deviation as hinge in \[nuisances\] .* 'thesis'"
    with pytest.raises(MethodError, match=message):
        NuisanceSet.of(free, ("hinge",), ())
    assert "hinge" not in NuisanceSet.of(THESIS, (), ()).others(THESIS, ())
    assert "hinge" in NuisanceSet.of(THESIS, (), ()).others(described(hinge=12.0), ())
    assert NuisanceSet.of(THESIS, ("hinge", "supply"), ("load_Nm",)).names == ("supply",)
    np.testing.assert_allclose(NuisanceSet.of(described(hinge=12.0), ("hinge",), ()).prior_deviations, [12.0])


def test_priors_have_the_documented_standard_deviations() -> None:
    names = ("load", "temperature", "supply", "inertia", "current_offset", "current_scale")
    # 6 % of 22.5 A × 0.0752 N·m/A; 30 K; 5 %, 5 %; 0.2 % of 22.5 A; 1 %.
    expected = [0.06 * 22.5 * 0.0752, 30.0, 0.05, 0.05, 2e-3 * 22.5, 0.01]
    np.testing.assert_allclose(NuisanceSet.of(THESIS, names, ()).prior_deviations, expected, rtol=1e-3)


# Effect on the lumped parameters.


def test_resistance_and_torque_constant_depend_on_the_temperature() -> None:
    nuisances = NuisanceSet.of(THESIS, ("temperature",), ())
    values = nuisances.values(np.array([[0.0], [40 / 30 / PRIORS_PER_UNIT], [-20 / 30 / PRIORS_PER_UNIT]]))
    np.testing.assert_allclose(values["temperature"], [0.0, 40.0, -20.0])
    for known in (0.0, 15.0):
        changed = nuisances.lumped_parameters(THESIS, values, known)
        assert set(changed) == {"resistance", "torque_constant"}
        for i, kelvin in enumerate((0.0, 40.0, -20.0)):
            for name, value in warmed(kelvin + known).items():
                assert changed[name][i] == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("gain", [0.5, 3.0])
def test_the_recorded_temperature_rise_is_multiplied_by_the_gain(gain: float) -> None:
    actuator = with_lumped_parameters(
        law_named("winding-temperature").added_to(THESIS), {"temperature_gain": gain}
    )
    # The recorded rise is multiplied; the estimated rise is that of the windings and is not.
    unknown = NuisanceSet.of(actuator, ("temperature",), ())
    values = unknown.values(np.array([[0.0], [10 / 30 / PRIORS_PER_UNIT]]))
    for known in (0.0, 15.0):
        changed = unknown.lumped_parameters(actuator, values, known)
        assert set(changed) == {"resistance", "torque_constant"}
        for i, estimated in enumerate((0.0, 10.0)):
            for name, value in warmed(gain * known + estimated).items():
                assert changed[name][i] == pytest.approx(value, rel=1e-12)
    # A free gain scales the recorded rise by a factor.
    free = NuisanceSet.of(actuator, (), (), ParameterVariation.free(actuator, ("temperature_gain",)))
    changed = free.lumped_parameters(actuator, free.values(np.array([[np.log(2.0)]])), 15.0)
    for name, value in warmed(2 * gain * 15.0).items():
        assert changed[name] == pytest.approx(value, rel=1e-12)


def test_viscous_friction_falls_with_recorded_and_estimated_temperature() -> None:
    actuator = with_lumped_parameters(
        law_named("viscous-temperature").added_to(THESIS), {"viscous_temperature": 0.02}
    )
    cold = lumped_parameters(THESIS, ("viscous",))["viscous"]
    nuisances = NuisanceSet.of(actuator, ("temperature",), ())
    changed = nuisances.lumped_parameters(
        actuator, nuisances.values(np.array([[5 / 30 / PRIORS_PER_UNIT]])), 15.0
    )
    assert changed["viscous"] == pytest.approx(cold * np.exp(-0.02 * 20.0), rel=1e-12)


@given(st.floats(1e-3, 1e6), st.sampled_from(["inertia", "supply", "temperature"]))
def test_lumped_parameters_stay_positive_for_priors_of_any_width(deviation: float, name: str) -> None:
    nuisances = NuisanceSet.of(described(**{name: deviation}), (name,), ())
    changed = nuisances.lumped_parameters(THESIS, nuisances.values(np.array([[-0.8], [0.8]])))
    assert changed
    for values in changed.values():
        assert np.all(values > 0)


@pytest.mark.parametrize(
    ("name", "value", "changed"),
    [
        ("load", 0.1, {"offset": 0.1}),
        ("hinge", 12.0, {"hinge": 12.0}),
        ("temperature", 40.0, warmed(40.0)),
        ("supply", -0.1, {"supply": 0.9 * 48.0}),
        ("inertia", 0.1, {"inertia": 1.1 * 2.5e-5}),
    ],
)
def test_a_nuisance_acts_as_a_change_of_lumped_parameters(
    name: str, value: float, changed: dict[str, float]
) -> None:
    # The recording of the changed actuator equals the output of the described one under the nuisance.
    actuator = described(hinge=10.0)
    # In the averaged model the supply acts only where it limits the current, as in fast motion.
    command = Sine(0.05, 8.0) if name == "supply" else Chirp()
    whole = simulate(with_lumped_parameters(actuator, changed), command, faults=TRUTH, model="averaged")
    kept = ("time_s", "command_rad", "current_A", "voltage_V", "position_rad", "speed_rad_s")
    recording = Recording({channel: whole[channel] for channel in kept})
    fit = faults_objective(problem_of(recording, actuator, channels=None), (name,))
    point = fit.space.points(TRUTH.vector)
    plain = fit.outputs(point[np.newaxis])[0, : fit.channel_rows]
    point[-1] = value / fit.space.nuisances.prior_deviations[0] / PRIORS_PER_UNIT
    outputs = fit.outputs(point[np.newaxis])[0, : fit.channel_rows]
    scale = np.sqrt(np.mean(fit.target**2))
    deviation, plain_deviation = (
        np.sqrt(np.mean((fit.target[: fit.channel_rows] - o) ** 2)) for o in (outputs, plain)
    )
    # The command is recorded as means and interpolated: the plain deviation exceeds that error by far.
    assert deviation < 0.01 * scale
    assert plain_deviation > 3 * deviation


def test_the_nuisance_has_the_sign_of_an_unrecorded_load() -> None:
    whole = simulate(THESIS, Chirp(), faults=TRUTH, model="averaged", load=0.1)
    recording = Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A")})
    diagnosis = diagnose(recording, THESIS, max_corrections=0, workers=1)
    assert diagnosis.nuisances["load"].value == pytest.approx(0.1, abs=0.005)


def test_nuisances_have_the_units_of_the_description() -> None:
    units = {name: unit_of(name) for name in NAMES}
    of_channels = {"current": "A", "voltage": "V", "position": "rad", "speed": "rad/s"}
    of_errors = {"offset": None, "drift": None, "scale": "-", "delay": "s"}
    errors = {
        f"{quantity}_{kind}": unit or own
        for quantity, own in of_channels.items()
        for kind, unit in of_errors.items()
    }
    assert units == {
        **errors,
        "delay": "s",
        "load": "N·m",
        "hinge": "N·m/rad",
        "load_variation": "N·m",
        "temperature": "K",
        "supply": "-",
        "inertia": "-",
    }


# Recorded quantities are known.


def estimated_faults(actuator: Actuator, load: Load = 0.0, **known: float) -> Array:
    """Return the faults of an `actuator` estimated by the description THESIS, with `known` recorded."""
    whole = simulate(actuator, Chirp(duration=0.2), duration=0.2, faults=TRUTH, noise=0.05, load=load)
    rows = {name: whole[name] for name in ("time_s", "command_rad", "current_A")}
    channels = {name: np.full(whole.samples, value) for name, value in known.items()}
    nuisances = None if known else ()
    return diagnose(Recording(rows | channels), THESIS, nuisances=nuisances, workers=1).faults.vector


@pytest.fixture(scope="module")
def plain() -> Array:
    return estimated_faults(THESIS)


@pytest.mark.usefixtures("one_search")
def test_a_recorded_temperature_removes_the_bias_by_heat(plain: Array) -> None:
    warm = with_lumped_parameters(THESIS, warmed(40.0))
    hot, unaware = estimated_faults(warm, temperature_K=293.15 + 40.0), estimated_faults(warm)
    # Noise and chaotic switching of two recordings: 0.02, the accuracy of a short; 40 K change it by 0.04.
    np.testing.assert_allclose(hot, plain, rtol=0, atol=0.02)
    assert np.abs(unaware - plain).max() > 0.03


@pytest.mark.evidence
@pytest.mark.usefixtures("one_search")
def test_a_recorded_load_removes_its_bias(plain: Array) -> None:
    loaded, unaware = estimated_faults(THESIS, load=0.15, load_Nm=0.15), estimated_faults(THESIS, load=0.15)
    np.testing.assert_allclose(loaded, plain, rtol=0, atol=0.02)
    assert np.abs(unaware - plain).max() > 0.1


def test_the_temperature_rise_is_relative_to_the_described_temperature() -> None:
    electrical = {**THESIS.model_dump()["electrical"], "temperature": 313.15}
    warm = Actuator.from_dict(THESIS.model_dump() | {"electrical": electrical})
    whole = simulate(THESIS, Chirp(), model="averaged", duration=0.1)
    kept = {name: whole[name] for name in ("time_s", "command_rad", "current_A")}
    recording = Recording(kept | {"temperature_K": np.linspace(310.0, 330.0, whole.samples)})
    for actuator, temperature_rise_K in ((THESIS, 26.85), (warm, 6.85)):
        fit = faults_objective(problem_of(recording, actuator, channels=None), None)
        assert fit.problem.temperature_rise_K == pytest.approx(temperature_rise_K)
        assert fit.space.nuisances.names == ("load",)


# Priors in the file of an actuator.


def test_priors_are_written_to_a_file_and_read_back_without_defaults(tmp_path: Path) -> None:
    path = tmp_path / "actuator.toml"
    THESIS.to_toml(path)
    assert "[nuisances]" not in path.read_text(encoding="utf-8")
    actuator = described(estimated=["hinge", "supply"], hinge=12.0, supply=0.02)
    actuator.to_toml(path)
    text = path.read_text(encoding="utf-8")
    assert Actuator.from_toml(path) == actuator
    assert "hinge = 12.0 # N·m/rad: " in text
    assert "current_scale" not in text
    assert NuisanceSet.of(Actuator.from_toml(path), None, ()).names == ("hinge", "supply")


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("load = 0.0", "'nuisances.load': should be greater than 0, got 0.0"),
        ("temperature = -30.0", "'nuisances.temperature': should be greater than 0, got -30.0"),
        ("inertia = inf", "'nuisances.inertia': should be a finite number, got inf"),
        ('supply = "5 %"', "'nuisances.supply': should be a valid number, got '5 %'"),
        ("temprature = 30.0", r"unknown key 'nuisances.temprature' (did you mean 'temperature'?)"),
        ('estimated = ["laod"]', "'nuisances.estimated.0': should be 'load', 'hinge',"),
        ('estimated = "load"', "'nuisances.estimated': should be a valid tuple, got 'load'"),
    ],
)
def test_a_bad_prior_is_refused_in_one_line(line: str, complaint: str, tmp_path: Path) -> None:
    path = tmp_path / "actuator.toml"
    THESIS.to_toml(path)
    path.write_text(path.read_text(encoding="utf-8") + f"\n[nuisances]\n{line}\n", encoding="utf-8")
    with pytest.raises(ActuatorError) as caught:
        Actuator.from_toml(path)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{path}: ")
    assert complaint in message
