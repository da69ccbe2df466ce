"""Collinear sets, found in covariances of known structure."""

import numpy as np
import pytest

from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.arrays import Array
from emaphm.diagnosis import diagnose
from emaphm.estimation.uncertainty.collinearity import (
    CollinearSet,
    collinear_coordinates,
    listed,
    resolving_channels,
)
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate


def measured_covariance(*rows: tuple[float, ...], prior: float = 1.0) -> Array:
    """Return the covariance after a measurement of each row's combination to 1 %, with a weak prior."""
    matrix = np.array(rows, float)
    return np.asarray(np.linalg.inv(matrix.T @ matrix / 0.01**2 + np.eye(matrix.shape[1]) / prior**2))


def members(covariance: Array) -> list[list[int]]:
    return [list(group) for group in collinear_coordinates(covariance)]


def test_parameters_measured_separately_form_no_collinear_set() -> None:
    assert members(measured_covariance((1, 0, 0), (0, 1, 0), (0, 0, 1))) == []


def test_parameters_measured_as_a_sum_form_a_collinear_set() -> None:
    assert members(measured_covariance((1, 0, 1, 0), (0, 1, 0, 0), (0, 0, 0, 1))) == [[0, 2]]


def test_an_unmeasured_parameter_is_in_no_collinear_set() -> None:
    # Its error is the same with all other parameters known: it is collinear with none of them.
    assert members(measured_covariance((1, 0, 0), (0, 1, 0))) == []


def test_two_measured_sums_form_two_collinear_sets() -> None:
    groups = members(measured_covariance((1, 1, 0, 0), (0, 0, 1, -1)))
    assert sorted(groups) == [[0, 1], [2, 3]]


def test_collinear_sets_do_not_depend_on_units() -> None:
    scale = np.array([1e-3, 1.0, 1e3, 1.0])
    covariance = measured_covariance((1, 0, 1, 0), (0, 1, 0, 0), (0, 0, 0, 1))
    assert members(covariance * np.outer(scale, scale)) == [[0, 2]]


def test_parts_known_nearly_as_well_as_their_sum_form_no_collinear_set() -> None:
    # The difference is known to 2 %: each part to about 1.1 %, and to 0.9 % when the other part is known.
    assert members(measured_covariance((1, 1), (0.5, -0.5))) == []


def test_information_on_the_difference_resolves_a_sum() -> None:
    covariance = measured_covariance((1, 1, 0), (0, 0, 1))
    more = {"difference": np.array([[1.0, -1, 0], [-1, 1, 0], [0, 0, 0]]) / 0.01**2}
    more["third"] = np.diag([0.0, 0, 1]) / 0.01**2
    more["one part"] = np.diag([1.0, 0, 0]) / 0.01**2
    more["one part, badly"] = np.diag([1.0, 0, 0]) / 2.0**2
    assert resolving_channels(covariance, [0, 1], more) == ("difference", "one part")


@pytest.mark.parametrize(
    ("names", "text"), [(["a"], "a"), (["a", "b"], "a and b"), (["a", "b", "c"], "a, b and c")]
)
def test_names_are_joined_as_a_list(names: list[str], text: str) -> None:
    assert listed(names, "and") == text


def test_a_collinear_set_names_the_channels_that_would_resolve_it() -> None:
    group = CollinearSet(("short_a", "temperature"), ("current_A",), ("voltage_V", "temperature_K"))
    assert str(group).endswith("Recording voltage_V or temperature_K too would separate them.")
    assert "Recording" not in str(CollinearSet(group.members, group.channels))


def test_heat_and_a_short_in_all_phases_are_collinear_unless_the_voltage_is_recorded() -> None:
    actuator = Actuator.thesis()
    faults = Faults(friction=0.2, short_a=0.3, short_b=0.3, short_c=0.3)
    command = Chirp(duration=0.3)
    whole = simulate(actuator, command, duration=0.3, faults=faults, noise=0.05, adc_bits=12)

    def sets_from(*channels: str) -> tuple[CollinearSet, ...]:
        rows = {name: whole[name] for name in ("time_s", "command_rad", *channels)}
        return diagnose(Recording(rows), actuator, nuisances=actuator.nuisances.estimated).collinear_sets

    (group,) = sets_from("current_A")
    assert group.members == ("short_a", "short_b", "short_c", "temperature")
    assert set(group.resolving) >= {"voltage_V", "temperature_K"}
    assert sets_from("current_A", "voltage_V") == ()
