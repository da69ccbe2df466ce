"""The error of a diagnosis: values by hand, circle and weight of the phase (docs/physics.md, section 8)."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given

from emaphm.actuator import Faults
from emaphm.arrays import Array
from emaphm.diagnosis import error_percent
from emaphm.errors import FaultError
from strategies import UNIT, fault_vectors

ROUNDING = 1e-9
"""Rounding error of a sum of eight squares of numbers up to 1, times 100."""


@pytest.mark.parametrize("name", ["friction", "backlash", "short_a", "short_b", "short_c", "gain"])
def test_a_deviation_of_0_05_in_one_component_is_five_percent(name: str) -> None:
    truth = Faults(gain=0.4)
    found = Faults.from_mapping({"gain": 0.4} | {name: getattr(truth, name) + 0.05})
    assert error_percent(truth.vector, found.vector) == pytest.approx(5.0)


def test_faults_and_their_vectors_are_accepted() -> None:
    truth, found = Faults(friction=0.03, gain=0.4), Faults(short_b=0.04, gain=0.4)
    assert error_percent(truth, found) == pytest.approx(5.0)  # sqrt(0.03² + 0.04²)
    assert error_percent(truth, np.array([found.vector, truth.vector])).tolist() == pytest.approx([5.0, 0.0])


@pytest.mark.parametrize("wrong", [[0.0] * 7, [0.0] * 9, [], 0.0, "ab", {"friction": 0.1}, [1j] * 8])
def test_arguments_that_are_no_fault_vectors_are_refused(wrong: Any) -> None:
    for pair in ((wrong, Faults()), (Faults(), wrong)):
        with pytest.raises(FaultError, match="a fault vector"):
            error_percent(*pair)


def test_deviations_of_components_add_as_squares() -> None:
    # sqrt(0.03² + 0.04² + 0.12²) = 0.13.
    found = Faults(friction=0.03, short_b=0.04, gain=0.62)
    assert error_percent(Faults().vector, found.vector) == pytest.approx(13.0)


def test_the_eccentricity_counts_once() -> None:
    truth, found = Faults(eccentricity=0.5), Faults(eccentricity=0.45)
    assert error_percent(truth.vector, found.vector) == pytest.approx(5.0)


@pytest.mark.parametrize(
    ("eccentricity", "true", "found", "percent"),
    [
        (1.0, 0.30, 0.35, 5.0),
        (0.25, 0.30, 0.40, 5.0),  # sqrt(0.25) × 0.1
        (0.25, 0.95, 0.05, 5.0),  # a tenth of a turn across the cut
        (1.0, 0.00, 1.00, 0.0),  # the same angle
        (1.0, 0.25, 0.75, 50.0),  # opposite: the largest difference
        (1.0, 0.10, 0.90, 20.0),
        (0.0, 0.10, 0.40, 0.0),  # meaningless without eccentricity
    ],
)
def test_the_phase_is_compared_on_its_circle_with_the_weight_of_the_true_eccentricity(
    eccentricity: float, true: float, found: float, percent: float
) -> None:
    truth = Faults(eccentricity=eccentricity, eccentricity_phase=true)
    guess = Faults(eccentricity=eccentricity, eccentricity_phase=found)
    assert error_percent(truth.vector, guess.vector) == pytest.approx(percent, abs=ROUNDING)


def test_the_weight_of_the_phase_is_that_of_the_truth_and_not_of_the_estimate() -> None:
    truth = Faults(eccentricity=0.0, eccentricity_phase=0.1)
    found = Faults(eccentricity=0.3, eccentricity_phase=0.6)
    assert error_percent(truth.vector, found.vector) == pytest.approx(30.0)
    assert error_percent(found.vector, truth.vector) == pytest.approx(100 * np.hypot(0.3, np.sqrt(0.3) * 0.5))


@given(truth=fault_vectors(), found=fault_vectors(), weight=UNIT)
def test_the_error_is_within_the_bounds_by_its_components(truth: Array, found: Array, weight: float) -> None:
    truth[5] = weight
    error = error_percent(truth, found)
    largest = 100 * np.sqrt(np.sum((truth - found)[[0, 1, 2, 3, 4, 5, 7]] ** 2) + 0.25 * weight)
    assert error <= largest + ROUNDING
    assert error >= 100 * np.max(np.abs(truth - found)[[0, 1, 2, 3, 4, 5, 7]]) - ROUNDING
    assert error_percent(truth, truth) == 0


@given(truth=fault_vectors(), found=fault_vectors())
def test_rows_are_compared_separately(truth: Array, found: Array) -> None:
    table = error_percent(np.stack([truth, found]), np.stack([found, found]))
    np.testing.assert_array_equal(table, [error_percent(truth, found), 0.0])
    np.testing.assert_array_equal(error_percent(truth, np.stack([found, truth])), [table[0], 0.0])
