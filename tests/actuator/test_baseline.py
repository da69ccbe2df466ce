"""A baseline in an actuator's file: values kept by a round trip, and refused values."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.actuator.unit.baseline import Baseline
from emaphm.errors import ActuatorError

THESIS = Actuator.thesis()
COVARIANCE = [[4e-4, 1e-4, 1e-6], [1e-4, 9e-4, 0.0], [1e-6, 0.0, 1e-5]]
GOOD: dict[str, Any] = {
    "names": ["inertia", "coulomb", "offset"],
    "covariance": COVARIANCE,
    "recordings": ["monday.csv", "tuesday.csv"],
}


def with_baseline(**changed: object) -> Actuator:
    return Actuator.from_dict(THESIS.model_dump() | {"baseline": GOOD | changed})


def test_a_baseline_is_read_back_to_the_last_bit(tmp_path: Path) -> None:
    root = np.random.default_rng(0).normal(0.0, 0.03, (3, 3))
    baseline = Baseline.of(("inertia", "coulomb", "offset"), root @ root.T, ("monday.csv",))
    actuator = Actuator.from_dict(THESIS.model_dump() | {"baseline": baseline.model_dump()})
    path = tmp_path / "unit.toml"
    actuator.to_toml(path)
    reread = Actuator.from_toml(path)
    assert reread == actuator
    assert reread.baseline is not None
    np.testing.assert_array_equal(reread.baseline.covariance, root @ root.T)


def test_a_description_without_calibration_has_no_baseline(tmp_path: Path) -> None:
    path = tmp_path / "thesis.toml"
    THESIS.to_toml(path)
    assert THESIS.baseline is None
    assert "[baseline]" not in path.read_text(encoding="utf-8")
    assert Actuator.from_toml(path).baseline is None


def test_a_change_of_other_values_keeps_the_baseline() -> None:
    actuator = with_baseline()
    assert with_lumped_parameters(actuator, {"inertia": 3e-5}).baseline == actuator.baseline


def test_a_baseline_may_know_a_parameter_exactly() -> None:
    assert with_baseline(covariance=np.zeros((3, 3)).tolist()).baseline is not None
    # Two parameters of which only one combination is unknown.
    assert with_baseline(names=["inertia", "coulomb"], covariance=[[1e-4, 1e-4], [1e-4, 1e-4]]).baseline


@pytest.mark.parametrize(
    ("changed", "complaint"),
    [
        (
            {"names": ["inertai", "coulomb", "offset"]},
            "'baseline.names': unknown parameter 'inertai' (did you",
        ),
        ({"names": ["inertia", "inertia", "offset"]}, "'baseline.names': parameter 'inertia' is named twice"),
        ({"names": ["inertia", "speed_lag", "offset"]}, "'baseline.names': 'speed_lag' is 0 in [controller]"),
        (
            {"names": ["inertia", "offset"]},
            "'baseline.covariance': must have a row and a column for each of 2",
        ),
        ({"covariance": COVARIANCE[:2]}, "'baseline.covariance': must have a row and a column for each of 3"),
        ({"covariance": [[1.0], [1.0, 2.0], []]}, "has 3 rows of 0 and 1 and 2"),
        (
            {"covariance": np.triu(COVARIANCE).tolist()},
            "'baseline.covariance': must be symmetric; row 1, column 2",
        ),
        ({"covariance": np.diag([1e-4, -1e-9, 1.0]).tolist()}, "must be positive semidefinite"),
        (
            {"covariance": [[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]]},
            "must be positive semidefinite",
        ),
        (
            {"covariance": np.diag([1.0, np.inf, 1.0]).tolist()},
            "'baseline.covariance.1.1': should be a finite",
        ),
        (
            {"covariance": [["small"] * 3] * 3},
            "'baseline.covariance.0.0': should be a valid number, got 'small'",
        ),
        ({"recordings": []}, "'baseline.recordings': "),
        ({"recording": "monday.csv"}, "unknown key 'baseline.recording' (did you mean 'recordings'?)"),
    ],
)
def test_an_impossible_baseline_is_refused_in_one_line(changed: dict[str, object], complaint: str) -> None:
    with pytest.raises(ActuatorError) as caught:
        with_baseline(**changed)
    assert "\n" not in str(caught.value)
    assert complaint in str(caught.value)
    assert len(str(caught.value)) < 300


def test_a_baseline_needs_the_section_of_its_parameters() -> None:
    values = THESIS.model_dump() | {"electrical": None}
    baseline = {"names": ["resistance"], "covariance": [[1e-4]], "recordings": ["monday.csv"]}
    with pytest.raises(ActuatorError, match=r"'resistance' needs \[electrical\] with it; add it"):
        Actuator.from_dict(values | {"baseline": baseline})
