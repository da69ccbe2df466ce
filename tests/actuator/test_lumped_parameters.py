"""Totals referred to the motor shaft: reading them from an actuator and setting them."""

import pytest
from hypothesis import given

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import TOTALS, totals, with_totals
from emaphm.errors import ActuatorError, MethodError
from strategies import actuators

THESIS = Actuator.thesis()
MECHANICAL = tuple(name for name in TOTALS if name not in {"resistance", "inductance", "supply"})


def test_totals_of_the_thesis() -> None:
    # Sums of the table in docs/physics.md, section 1, which knows no lags.
    assert totals(THESIS, tuple(TOTALS)) == pytest.approx(
        {
            "inertia": 2.5e-5,
            "viscous": 9.99930e-6,
            "coulomb": 0.08445,
            "static": 0.1689,
            "offset": 0.0,
            "hinge": 0.0,
            "position_gain": 1e5,
            "speed_gain": 5e-2,
            "speed_lag": 0.0,
            "torque_lag": 0.0,
            "torque_constant": 0.0752,
            "resistance": 2.13,
            "inductance": 7.2e-4,
            "supply": 48.0,
        },
        rel=1e-6,  # the digits written here
    )


@given(actuator=actuators())
def test_setting_the_totals_that_it_has_changes_nothing(actuator: Actuator) -> None:
    names = tuple(TOTALS) if actuator.electrical else MECHANICAL
    same = with_totals(actuator, totals(actuator, names))
    kept = {"end_stops"}
    # Shares of a sum take a few roundings.
    assert same.mechanics.model_dump(exclude=kept) == (
        pytest.approx(actuator.mechanics.model_dump(exclude=kept), rel=1e-12)
    )
    others = {"mechanics"}
    assert same.model_dump(exclude=others) == actuator.model_dump(exclude=others)


@pytest.mark.parametrize("name", TOTALS)
def test_a_total_that_was_set_is_read_back_and_the_others_stay(name: str) -> None:
    value = 0.19 if name == "static" else 0.06
    changed = with_totals(THESIS, {name: value}, name="calibrated")
    assert changed.name == "calibrated"
    before, after = totals(THESIS, tuple(TOTALS)), totals(changed, tuple(TOTALS))
    follows = {"static": 2 * value} if name == "coulomb" else {}  # at its ratio of f_s / f_d = 2
    assert after == pytest.approx(before | {name: value} | follows, rel=1e-12)


def test_motor_and_user_keep_their_shares() -> None:
    m = with_totals(THESIS, {"inertia": 5e-5, "coulomb": 0.05, "static": 0.2}).mechanics
    assert m.inertia_motor / m.inertia_user == pytest.approx(1.3 / 1.2)
    assert m.dynamic_friction_motor / m.dynamic_friction_user == pytest.approx(1.5)
    assert m.static_friction_motor / m.static_friction_user == pytest.approx(1.5)


def test_a_total_of_nothing_goes_to_the_motor() -> None:
    values = THESIS.model_dump()
    values["mechanics"] |= {"viscous_motor": 0.0, "viscous_user": 0.0}
    m = with_totals(Actuator.from_dict(values), {"viscous": 1e-4}).mechanics
    assert (m.viscous_motor, m.viscous_user) == (1e-4, 0.0)


def test_what_cannot_be_set_is_refused() -> None:
    with pytest.raises(MethodError, match=r"unknown parameter 'intertia' \(did you mean 'inertia'\?\)"):
        with_totals(THESIS, {"intertia": 1.0})
    with pytest.raises(ActuatorError, match=r"thesis: 'mechanics\.inertia_motor'.*greater than"):
        with_totals(THESIS, {"inertia": -1e-5})
    with pytest.raises(ActuatorError, match="dynamic friction"):
        with_totals(THESIS, {"coulomb": 0.3, "static": 0.2})
    without = Actuator.from_dict(THESIS.model_dump(exclude={"electrical"}))
    with pytest.raises(MethodError, match=r"'resistance' needs an \[electrical\] section"):
        totals(without, ("resistance",))
