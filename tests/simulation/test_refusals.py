"""Refused arguments: one line that states the correction."""

import importlib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from emaphm.actuator import Chirp, Sampled
from emaphm.actuator.actuator import described_parts
from emaphm.actuator.laws import LAWS
from emaphm.actuator.lumped_parameters import OPTIONAL
from emaphm.actuator.unit.baseline import PARTS, SECTIONS
from emaphm.arrays import Array
from emaphm.errors import EmaphmError, FaultError, MethodError, SignalError
from emaphm.simulation import (
    AVERAGED,
    MODELS,
    REFERENCE,
    Inputs,
    Plant,
    model_named,
    monitor,
    run,
    simulate_batch,
)
from simulation.rig import INTERVAL, THESIS, altered, record

HEALTHY = np.array([0, 0, 0, 0, 0, 0, 0.5, 0.5])
IDEAL = altered(electrical=None)


def inputs(**changes: Any) -> Inputs:
    options: dict[str, Any] = {"command": Chirp(), "samples": 5, "interval": INTERVAL, "step": 5e-5}
    return Inputs.of(**(options | changes))


@pytest.mark.parametrize("name", ["reference", "monitor", "averaged"])
def test_models_are_selected_by_name(name: str) -> None:
    assert model_named(name) is MODELS[name]


def test_an_unknown_model_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(MethodError, match=r"unknown model 'avreaged' \(did you mean 'averaged'\?\)"):
        model_named("avreaged")
    with pytest.raises(MethodError, match=r"unknown model 'x' \(known: averaged, monitor, reference\)"):
        model_named("x")


@pytest.mark.parametrize("form", [{"shorts": "modulatd"}, {"eccentricity": "print"}])
def test_an_unknown_form_of_the_monitor_model_is_refused(form: dict[str, Any]) -> None:
    with pytest.raises(MethodError, match="did you mean"):
        monitor(**form)


def test_an_unknown_lumped_parameter_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(MethodError, match=r"unknown parameter 'inertai' \(did you mean 'inertia'\?\)"):
        Plant.of(THESIS, HEALTHY, {"inertai": 1e-5})


@pytest.mark.parametrize("name", SECTIONS["electrical"])
def test_a_lumped_parameter_of_windings_requires_windings(name: str) -> None:
    with pytest.raises(
        MethodError, match=rf"'{name}' needs an \[electrical\] section, which .*'thesis' lacks"
    ):
        Plant.of(IDEAL, HEALTHY, {name: 1.0})


@pytest.mark.parametrize(
    "name", [name for name, (section, *_) in PARTS.items() if {section, name} & {*OPTIONAL}]
)
def test_a_parameter_of_an_optional_law_requires_the_law(name: str) -> None:
    section = PARTS[name][0]
    where = r"\[\[ripple\]\]" if section == "ripple" else rf"{name} in \[{section}\]"
    with pytest.raises(MethodError, match=rf"'{name}' needs {where}, which .*'thesis' lacks; add it"):
        Plant.of(THESIS, HEALTHY, {name: 0.5})


@pytest.mark.parametrize("law", LAWS)
def test_the_parameters_of_a_described_law_can_be_set(law: str) -> None:
    actuator = LAWS[law].added_to(THESIS)
    named = [name for name in LAWS[law].parameters if described_parts(actuator, name) is not None]
    plant = Plant.of(actuator, HEALTHY, dict.fromkeys(named, 0.5))
    of_ripples = [name for name in named if name.startswith("ripple")]
    assert np.count_nonzero(plant.ripples == 0.5) == len(of_ripples)
    for name in set(named) - set(of_ripples):
        assert getattr(plant, name) == 0.5


@pytest.mark.parametrize(
    "name",
    [
        name
        for name, (section, *_) in PARTS.items()
        if section in {"mechanics", "controller", "motor"} and name not in OPTIONAL
    ],
)
def test_other_lumped_parameters_require_no_section(name: str) -> None:
    assert Plant.of(IDEAL, HEALTHY, {name: 1.0}).count == 1


def test_lumped_parameters_of_another_length_are_refused() -> None:
    with pytest.raises(MethodError, match="inertia"):
        Plant.of(THESIS, np.tile(HEALTHY, (2, 1)), {"inertia": [1e-5, 2e-5, 3e-5]})


@pytest.mark.parametrize("value", [0.0, -1e-5, np.nan])
def test_an_impossible_lumped_parameter_is_refused(value: float) -> None:
    with pytest.raises(MethodError, match="inertia"):
        Plant.of(THESIS, HEALTHY, {"inertia": value})


def test_static_friction_below_dynamic_friction_causes_no_motion() -> None:
    # Friction larger than the torque that it balances would move a shaft at rest against its load.
    plant = Plant.of(THESIS, HEALTHY, {"coulomb": 0.2, "static": 0.1})
    given = Inputs.of(lambda t: 0 * t, 0.15, samples=50, interval=INTERVAL, step=5e-5)
    assert not np.any(run(AVERAGED, plant, given)["speed_rad_s"] > 0)


@pytest.mark.parametrize("shape", [(7,), (2, 9), (1, 2, 8), (0,)])
def test_fault_vectors_of_another_shape_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(FaultError, match=r"fault vectors have shape \(n, 8\), got"):
        Plant.of(THESIS, np.zeros(shape))


@pytest.mark.parametrize("value", [-0.01, 1.01, np.nan, np.inf])
def test_a_fault_outside_the_unit_interval_is_refused(value: float) -> None:
    k = np.tile(HEALTHY, (3, 1))
    k[2, 1] = value
    with pytest.raises(FaultError, match=r"fault backlash=\S+ of vector 2 lies outside \[0, 1\]; give"):
        Plant.of(THESIS, k)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_command_or_load_that_is_not_finite_is_refused(value: float) -> None:
    with pytest.raises(SignalError, match="the command is not finite"):
        inputs(command=lambda t: np.where(t > 4e-4, value, 0.0))
    with pytest.raises(SignalError, match="the load is not finite"):
        inputs(load=value)
    with pytest.raises(SignalError, match="the load is not finite"):
        inputs(load=lambda t: t + value)


def test_a_command_or_load_beyond_any_actuator_is_refused() -> None:
    with pytest.raises(SignalError, match=r"the command reaches 1e\+308, beyond any actuator"):
        inputs(command=lambda t: np.full(t.shape, -1e308))
    with pytest.raises(SignalError, match=r"the load reaches 1e\+16, beyond any actuator"):
        inputs(load=1e16)


@pytest.mark.parametrize(
    "changes", [{"samples": 0}, {"samples": -3}, {"interval": 0.0}, {"interval": -1.0}, {"interval": np.nan}]
)
def test_a_run_without_samples_or_interval_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(SignalError, match="needs samples"):
        inputs(**changes)


@pytest.mark.parametrize("changes", [{"step": 0.0}, {"step": -1e-6}, {"noise": -1.0}])
def test_an_impossible_step_or_noise_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(SignalError):
        inputs(**changes)


def test_a_command_of_another_length_is_refused() -> None:
    with pytest.raises(SignalError, match="command"):
        inputs(command=lambda t: t[:3])


@pytest.mark.parametrize("name", ["command", "load", "noise", "enabled"])
@pytest.mark.parametrize("signal", [np.zeros(1), np.zeros(49), np.zeros((50, 1)), np.zeros(50, int)])
def test_a_signal_of_wrong_shape_or_type_is_refused(name: str, signal: Array) -> None:
    # Otherwise the kernel would read beyond the end of the array.
    given = Inputs.of(lambda t: 0 * t, samples=10, interval=2e-4, step=4e-5)
    changed: dict[str, Any] = {name: signal}
    with pytest.raises(SignalError, match=f"the {name} of a run is .* of shape .*; give 50 floats"):
        replace(given, **changed)


@pytest.mark.parametrize("count", [0, 2, 5])
def test_a_single_run_requires_a_single_actuator(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    # Otherwise the kernel would write beyond the end of its output.
    running = importlib.import_module("emaphm.simulation.engine.running")
    monkeypatch.setattr(running, "_advance", lambda *_, **__: pytest.fail("reached the kernel"))
    with pytest.raises(MethodError, match="use observe_batch"):
        run(AVERAGED, Plant.of(THESIS, np.tile(HEALTHY, (count, 1))), inputs())


def test_an_unstable_run_is_reported() -> None:
    # Explicit Euler is unstable where the step exceeds 2 L / R.
    stiff = altered(electrical={"inductance": 1e-8})
    with pytest.raises(MethodError, match="the reference model did not stay finite; check the actuator's"):
        record(REFERENCE, Chirp(), stiff, duration=0.02)
    given = Inputs.of(Chirp(), samples=100, interval=INTERVAL, step=1e-6)
    with pytest.raises(MethodError, match="did not stay finite"):
        simulate_batch(REFERENCE, stiff, [HEALTHY], given)


def test_the_monitor_model_requires_windings() -> None:
    with pytest.raises(MethodError, match="the monitor model has no drive of kind 'current'; it has hyst"):
        record(MODELS["monitor"], Chirp(), IDEAL, duration=0.01)


def test_refusals_are_errors_of_the_package_in_one_line() -> None:
    for refuse in (
        lambda: model_named("x"),
        lambda: Plant.of(THESIS, np.zeros(7)),
        lambda: inputs(samples=0),
        lambda: Sampled([0.0], [0.0]),
    ):
        with pytest.raises(EmaphmError) as caught:
            refuse()
        assert "\n" not in str(caught.value)
