"""The actuator's parameters, compared with the thesis's table; their sums; they cannot be modified."""

import math
import re
from typing import Any

import pytest
from hypothesis import given
from pydantic import ValidationError

from emaphm.actuator import Actuator
from emaphm.actuator.quantity import unit_for
from emaphm.errors import ActuatorError
from strategies import actuators

THESIS = Actuator.thesis()


def test_the_thesis_actuator_is_the_table_of_physics_section_1() -> None:
    c, m, motor, e = THESIS.controller, THESIS.mechanics, THESIS.motor, THESIS.electrical
    assert e is not None
    assert (c.position_gain, c.speed_gain, c.integral_gain, c.derivative_gain) == (1e5, 5e-2, 0, 0)
    assert (e.supply, c.current_limit, motor.torque_limit) == (48, 22.5, 1.689)
    assert (motor.torque_constant, c.torque_constant) == (0.0752, 0.0752)
    assert (e.resistance, e.inductance, e.pole_pairs, e.hysteresis) == (2.13, 7.2e-4, 2, 0.5)
    assert (m.inertia_motor, m.inertia_user) == (1.3e-5, 1.2e-5)
    assert m.viscous_motor == pytest.approx(30 / math.pi * 1e-6)
    assert m.viscous_user == 4.5e-7
    assert m.static_friction_motor == pytest.approx(0.06 * 1.689)
    assert m.static_friction_user == pytest.approx(0.04 * 1.689)
    assert m.dynamic_friction_motor == pytest.approx(0.03 * 1.689)
    assert m.dynamic_friction_user == pytest.approx(0.02 * 1.689)
    assert math.degrees(m.backlash) == pytest.approx(0.29, abs=0.005)  # the table's two digits
    assert c.speed_limit == pytest.approx(8000 / 60 * math.tau)
    assert (m.gear_ratio, m.end_stops) == (1 / 500, (-0.5236, 0.5236))
    assert m.end_stops is not None
    assert math.degrees(m.end_stops[1]) == pytest.approx(30, abs=1e-3)


@given(actuator=actuators())
def test_lumped_parameters_are_the_sums_of_motor_and_user(actuator: Actuator) -> None:
    m = actuator.mechanics
    assert m.inertia == m.inertia_motor + m.inertia_user
    assert m.viscous == m.viscous_motor + m.viscous_user
    assert m.static_friction == m.static_friction_motor + m.static_friction_user
    assert m.dynamic_friction == m.dynamic_friction_motor + m.dynamic_friction_user


PARTS = [
    THESIS,
    THESIS.controller,
    THESIS.motor,
    THESIS.mechanics,
    THESIS.electrical,
    THESIS.faults,
    THESIS.channels,
]


def test_values_are_changed_by_their_keys() -> None:
    heavier = THESIS.changed(
        {"mechanics.inertia_motor": 2e-5, "sensors.current_A.lag": 1e-4, "name": "unit 7"}
    )
    assert (heavier.mechanics.inertia_motor, heavier.sensors.current_A.lag) == (2e-5, 1e-4)
    assert heavier.name == "unit 7"
    back = heavier.changed(
        {"mechanics.inertia_motor": 1.3e-5, "sensors.current_A.lag": 0.0, "name": "thesis"}
    )
    assert back == THESIS
    assert THESIS.changed({}) == THESIS


@pytest.mark.parametrize(
    ("key", "value", "complaint"),
    [
        ("mechanics.inertia_moter", 1.0, "did you mean 'inertia_motor'?"),
        ("mechanic.inertia_motor", 1.0, "did you mean 'mechanics'?"),
        ("mechanics.inertia_motor", -1.0, "mechanics.inertia_motor"),
        ("mechanics.inertia_motor", math.nan, "mechanics.inertia_motor"),
        ("mechanics.inertia_motor", "1", "mechanics.inertia_motor"),
        ("electrical", None, "needs an [electrical] section"),
        ("name.first", "x", "'name'"),
    ],
)
def test_impossible_changes_are_refused(key: str, value: Any, complaint: str) -> None:
    drive = THESIS.changed({"drive.kind": "hysteresis"})
    with pytest.raises(ActuatorError, match=re.escape(complaint)) as error:
        drive.changed({key: value})
    assert "actuator 'thesis'" in str(error.value)
    assert "\n" not in str(error.value)


def test_a_copy_refuses_a_misspelt_field() -> None:
    with pytest.raises(ActuatorError, match=r"'inertia_moter'.*did you mean 'inertia_motor'"):
        THESIS.mechanics.model_copy(update={"inertia_moter": 1.0})


@pytest.mark.parametrize("part", PARTS, ids=lambda part: type(part).__name__)
def test_no_part_can_be_modified(part: Any) -> None:
    for name in type(part).model_fields:
        with pytest.raises(ValidationError, match="frozen"):
            setattr(part, name, getattr(part, name))


@pytest.mark.parametrize(
    ("section", "name", "units"),
    [
        ("mechanics", "inertia_motor", ("kg·m²", "kg", "kg·m²")),
        ("mechanics", "backlash", ("rad", "m", "rad")),
        ("mechanics", "end_stops", ("rad", "m", "m")),
        ("mechanics", "gear_ratio", ("-", "-", "m/rad")),
        ("mechanics", "hinge", ("N·m/rad", "N/m", "N·m/m")),
        ("controller", "position_gain", ("1/s", "1/s", "rad/(s·m)")),
        ("controller", "speed_gain", ("N·m·s/rad", "N·s/m", "N·m·s/rad")),
        ("electrical", "rotor_zero", ("rad", "rad", "rad")),
        ("electrical", "resistance", ("ohm", "ohm", "ohm")),
    ],
)
def test_units_are_those_of_motor_and_user(section: str, name: str, units: tuple[str, str, str]) -> None:
    extra = type(getattr(THESIS, section)).model_fields[name].json_schema_extra
    assert isinstance(extra, dict)
    assert tuple(unit_for(str(extra["unit"]), kind) for kind in ("rotary", "linear", "screw")) == units


def test_all_quantities_have_a_unit_and_a_source() -> None:
    for section in ("controller", "motor", "mechanics", "electrical", "faults"):
        for name, field in type(getattr(THESIS, section)).model_fields.items():
            extra = field.json_schema_extra
            assert isinstance(extra, dict), name
            assert extra["unit"], name
            assert extra["source"], name
