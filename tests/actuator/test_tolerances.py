"""Tolerances in an actuator's TOML: round trip, meaning, and refused values."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import lognorm

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import LUMPED_PARAMETERS
from emaphm.actuator.unit.baseline import SIGNED
from emaphm.actuator.unit.tolerances import LARGEST_TOLERANCE, Tolerances
from emaphm.errors import ActuatorError

THESIS = Actuator.thesis()
DESCRIBED = THESIS.model_copy(update={"tolerances": Tolerances(resistance=0.05, torque_constant=0.1)})


def test_tolerances_are_written_with_their_meaning_and_read_back(tmp_path: Path) -> None:
    path = tmp_path / "unit.toml"
    DESCRIBED.to_toml(path)
    assert Actuator.from_toml(path) == DESCRIBED
    text = path.read_text(encoding="utf-8")
    assert (
        "[tolerances]\ntorque_constant = 0.1 # -: ± torque constant, and back-EMF constant, relative" in text
    )
    THESIS.to_toml(path)
    assert "tolerances" not in path.read_text(encoding="utf-8")


def test_each_tolerance_belongs_to_a_positive_lumped_parameter() -> None:
    assert set(Tolerances.model_fields) <= set(LUMPED_PARAMETERS) - set(SIGNED)


@given(st.floats(1e-3, LARGEST_TOLERANCE))
def test_95_of_100_units_are_within_the_tolerance(tolerance: float) -> None:
    values = lognorm(s=Tolerances(inertia=tolerance).deviations["inertia"])
    within = values.cdf(1 + tolerance) - values.cdf(1 / (1 + tolerance))
    assert within == pytest.approx(0.95, abs=0.005)


def test_tolerances_are_optional() -> None:
    tolerances = Tolerances(resistance=0.05, torque_constant=0.1)
    assert tolerances.names == ("torque_constant", "resistance")
    assert tolerances.without(("inertia", "resistance")) == Tolerances(torque_constant=0.1)
    assert tolerances.without(tolerances.names) is None


@pytest.mark.parametrize(
    ("toml", "pieces"),
    [
        ("torqe_constant = 0.1", ("tolerances.torqe_constant", "did you mean 'torque_constant'?")),
        ("torque_constant = 0.0", ("tolerances.torque_constant", "greater than 0")),
        ("torque_constant = 10.0", ("tolerances.torque_constant", "less than or equal to 2", "got 10.0")),
        ('torque_constant = "10 %"', ("tolerances.torque_constant", "valid number")),
        ("", ("states no tolerance", "torque_constant = 0.1")),
        ("stiffness = 0.1", ("'tolerances': 'stiffness' needs [transmission]", "add it")),
        ("integral_gain = 0.1", ("'integral_gain' is 0 in [controller]", "leave it out")),
        ("offset = 0.1", ("unknown key 'tolerances.offset'",)),
    ],
)
def test_errors_name_the_wrong_value(tmp_path: Path, toml: str, pieces: tuple[str, ...]) -> None:
    path = tmp_path / "unit.toml"
    THESIS.to_toml(path)
    path.write_text(f"{path.read_text(encoding='utf-8')}\n[tolerances]\n{toml}\n", encoding="utf-8")
    with pytest.raises(ActuatorError) as caught:
        Actuator.from_toml(path)
    for piece in pieces:
        assert piece in str(caught.value)


def test_a_tolerance_of_a_negative_value_is_refused_with_that_value() -> None:
    with pytest.raises(ActuatorError, match=r"'hinge' is -0.5 in \[mechanics\]"):
        THESIS.changed({"mechanics.hinge": -0.5, "tolerances.hinge": 0.1})


def test_the_largest_tolerance_is_a_factor_of_three() -> None:
    assert Tolerances(viscous=LARGEST_TOLERANCE).deviations["viscous"] == pytest.approx(math.log(3) / 2)
