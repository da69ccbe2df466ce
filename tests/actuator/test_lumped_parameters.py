"""Lumped parameters referred to the motor shaft: reading from an actuator and setting."""

import numpy as np
import pytest
from hypothesis import given

from emaphm.actuator import Actuator, Faults
from emaphm.actuator.actuator import described_parts
from emaphm.actuator.lumped_parameters import LUMPED_PARAMETERS, lumped_parameters, with_lumped_parameters
from emaphm.errors import ActuatorError, MethodError
from emaphm.simulation import Plant
from strategies import EVERYTHING, actuators

THESIS = Actuator.thesis()
OF_THE_THESIS = tuple(name for name in LUMPED_PARAMETERS if described_parts(THESIS, name) is not None)

DESCRIBED = tuple(name for name in LUMPED_PARAMETERS if described_parts(EVERYTHING, name) is not None)


def test_lumped_parameters_of_the_thesis_actuator_are_those_of_physics() -> None:
    # Sums of the table in docs/physics.md, section 1, which has no lags.
    assert lumped_parameters(THESIS, OF_THE_THESIS) == pytest.approx(
        {
            "inertia": 2.5e-5,
            "viscous": 9.99930e-6,
            "coulomb": 0.08445,
            "static": 0.1689,
            "offset": 0.0,
            "hinge": 0.0,
            "backlash": 5e-3,
            "position_gain": 1e5,
            "position_integral_gain": 0.0,
            "position_derivative_gain": 0.0,
            "speed_gain": 5e-2,
            "integral_gain": 0.0,
            "derivative_gain": 0.0,
            "speed_feedforward": 0.0,
            "speed_feedback": 1.0,
            "command_lag": 0.0,
            "speed_lag": 0.0,
            "torque_lag": 0.0,
            "torque_constant": 0.0752,
            "resistance": 2.13,
            "inductance": 7.2e-4,
            "rotor_zero": 0.0,
            "supply": 48.0,
        },
        rel=1e-6,  # the digits written here
    )


@given(actuator=actuators())
def test_setting_the_present_lumped_parameters_changes_nothing(actuator: Actuator) -> None:
    names = tuple(name for name in LUMPED_PARAMETERS if described_parts(actuator, name) is not None)
    unchanged = with_lumped_parameters(actuator, lumped_parameters(actuator, names))
    unchanged_fields = {"end_stops"}
    # Shares of a sum have a few rounding errors.
    assert unchanged.mechanics.model_dump(exclude=unchanged_fields) == (
        pytest.approx(actuator.mechanics.model_dump(exclude=unchanged_fields), rel=1e-12)
    )
    sections = {"mechanics"}
    assert unchanged.model_dump(exclude=sections) == actuator.model_dump(exclude=sections)


@pytest.mark.parametrize("name", DESCRIBED)
def test_a_lumped_parameter_that_was_set_is_read_back_and_others_stay(name: str) -> None:
    value = {"static": 0.19, "current_lag": 2e-5, "commutation_delay": 2e-5}.get(name, 0.06)
    changed = with_lumped_parameters(EVERYTHING, {name: value}, name="calibrated")
    assert changed.name == "calibrated"
    before, after = lumped_parameters(EVERYTHING, DESCRIBED), lumped_parameters(changed, DESCRIBED)
    follows = {"static": 2 * value} if name == "coulomb" else {}  # at its ratio of f_s / f_d = 2
    assert after == pytest.approx(before | {name: value} | follows, rel=1e-12)


def test_motor_and_user_keep_their_shares_of_a_total() -> None:
    m = with_lumped_parameters(THESIS, {"inertia": 5e-5, "coulomb": 0.05, "static": 0.2}).mechanics
    assert m.inertia_motor / m.inertia_user == pytest.approx(1.3 / 1.2)
    assert m.dynamic_friction_motor / m.dynamic_friction_user == pytest.approx(1.5)
    assert m.static_friction_motor / m.static_friction_user == pytest.approx(1.5)


def test_a_total_that_was_zero_is_given_to_the_motor() -> None:
    values = THESIS.model_dump()
    values["mechanics"] |= {"viscous_motor": 0.0, "viscous_user": 0.0}
    m = with_lumped_parameters(Actuator.from_dict(values), {"viscous": 1e-4}).mechanics
    assert (m.viscous_motor, m.viscous_user) == (1e-4, 0.0)


@pytest.mark.parametrize("name", ["offset", "rotor_zero"])
def test_an_estimate_that_differs_from_0_by_rounding_is_0(name: str) -> None:
    unit = with_lumped_parameters(THESIS, {name: -5e-25})
    assert lumped_parameters(unit, (name,)) == {name: 0.0}


def test_impossible_lumped_parameters_are_refused() -> None:
    with pytest.raises(MethodError, match=r"unknown parameter 'intertia' \(did you mean 'inertia'\?\)"):
        with_lumped_parameters(THESIS, {"intertia": 1.0})
    with pytest.raises(ActuatorError, match=r"thesis: 'mechanics\.inertia_motor'.*greater than"):
        with_lumped_parameters(THESIS, {"inertia": -1e-5})
    with pytest.raises(ActuatorError, match="dynamic friction"):
        with_lumped_parameters(THESIS, {"coulomb": 0.3, "static": 0.2})
    without = Actuator.from_dict(THESIS.model_dump(exclude={"electrical"}))
    with pytest.raises(MethodError, match=r"'resistance' needs an \[electrical\] section"):
        lumped_parameters(without, ("resistance",))


def test_the_static_friction_of_several_actuators_keeps_its_ratio() -> None:
    plants = Plant.of(THESIS, np.tile(Faults().vector, (2, 1)), {"coulomb": [0.05, 0.1]})
    assert plants.static == pytest.approx([0.1, 0.2])


def test_a_drive_keeps_the_torque_constant_for_which_it_was_built() -> None:
    described = Actuator.thesis().model_dump(exclude_none=True)
    described["controller"]["torque_constant"] = None
    actuator = Actuator.from_dict(described)
    stronger = 1.2 * actuator.motor.torque_constant
    unit = with_lumped_parameters(actuator, {"torque_constant": stronger})
    # As a fit of the torque constant: only that of the motor changes.
    fitted = Plant.of(actuator, Faults().vector, {"torque_constant": stronger})
    assert unit.drive_constant == actuator.drive_constant == fitted.drive_constant
    assert unit.motor.torque_constant == stronger == fitted.torque_constant
