"""A unit that deviates from its data sheet: diagnosis and calibration with tolerances."""

import math
from collections.abc import Mapping

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.actuator.unit.tolerances import Tolerances
from emaphm.calibration import calibrate
from emaphm.diagnosis import diagnose
from emaphm.estimation.space.nuisances import NuisanceSet
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

WEAKER = {"torque_constant": 0.92, "inertia": 1.07}
"""Factors of the unit's parameters: about the limit of ± 10 % in a data sheet."""

STATED = {"torque_constant": 0.1, "inertia": 0.1}


def with_tolerances(**tolerances: float) -> Actuator:
    return THESIS.model_copy(update={"tolerances": Tolerances(**tolerances)})


def recorded(
    faults: Faults | None = None,
    *,
    seed: int = 1,
    amplitude: float = 5e-3,
    factors: Mapping[str, float] = WEAKER,
) -> Recording:
    described = lumped_parameters(THESIS, tuple(factors))
    unit = with_lumped_parameters(THESIS, {name: described[name] * f for name, f in factors.items()})
    command = Chirp(amplitude=amplitude, duration=0.2)
    whole = simulate(
        unit, command, faults=faults or Faults(), duration=0.2, noise=0.05, adc_bits=12, seed=seed
    )
    return Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")})


def test_a_healthy_unit_within_its_tolerances_is_not_called_degraded() -> None:
    # A weaker magnet, a warmer winding and shorts in all phases are confounded: no verdict names one of them.
    diagnosis = diagnose(recorded(), with_tolerances(**STATED), workers=1)
    assert diagnosis.explained
    assert not [name for name, one in diagnosis.components.items() if one.verdict == "degraded"]
    for name, factor in WEAKER.items():
        estimate = diagnosis.nuisances[f"baseline {name}"]
        # In one of 3000 units, one of two normal estimates deviates by more than 3.8 standard errors.
        assert abs(estimate.value - math.log(factor)) < 3.8 * estimate.standard_error


def test_faults_of_a_unit_within_its_tolerances_are_in_their_intervals() -> None:
    truth = Faults(friction=0.4, short_b=0.3, gain=0.6)
    diagnosis = diagnose(recorded(truth), with_tolerances(**STATED), workers=1)
    assert diagnosis.explained
    for name in ("friction", "short_a", "short_b", "short_c", "gain"):
        low, high = diagnosis.components[name].interval95
        assert low - 0.01 <= getattr(truth, name) <= high + 0.01
    assert diagnosis.components["short_b"].verdict == "degraded"
    assert diagnosis.components["short_a"].verdict != "degraded"


@pytest.mark.evidence
def test_a_unit_beyond_its_tolerance_is_not_explained() -> None:
    # An inertia that is too large may be read as shorts in all phases and friction below healthy.
    recording = recorded(factors={"inertia": 0.85})
    diagnosis = diagnose(recording, with_tolerances(torque_constant=0.1, inertia=0.02), workers=1)
    assert not diagnosis.explained
    assert any("more than its tolerance of ± 10 % accounts for" in reason for reason in diagnosis.reasons)


def test_a_baseline_replaces_a_tolerance() -> None:
    # The prior is that of the calibrated inertia, and not that of the data sheet.
    calibrated = calibrate(
        [recorded()], with_tolerances(**STATED), ("inertia",), max_corrections=0, workers=1
    )
    assert calibrated.actuator.tolerances is None
    with_both = calibrated.actuator.model_copy(update={"tolerances": Tolerances(inertia=0.5, resistance=0.1)})
    nuisances = NuisanceSet.of(with_both, (), ())
    assert nuisances.quantities.count("baseline inertia") == 1
    deviations = dict(zip(nuisances.quantities, nuisances.prior_deviations, strict=True))
    assert deviations["baseline inertia"] < 0.1
    assert deviations["baseline resistance"] == pytest.approx(math.log(1.1) / 2)


@pytest.mark.evidence
def test_calibration_estimates_parameters_within_their_tolerances() -> None:
    days = [recorded(seed=seed, amplitude=a) for seed, a in ((1, 5e-3), (2, 8e-3))]
    exact = calibrate(days, THESIS, ("inertia",), max_corrections=1, workers=1)
    calibration = calibrate(days, with_tolerances(**STATED), ("inertia",), max_corrections=1, workers=1)
    assert set(calibration.parameters) == {"inertia", "torque_constant"}
    true = WEAKER["inertia"] * lumped_parameters(THESIS, ("inertia",))["inertia"]
    errors = [abs(estimate.parameters["inertia"].value / true - 1) for estimate in (exact, calibration)]
    # The inertia is identified in proportion to the torque constant, which deviates by 8 %.
    assert errors[0] > 0.04
    assert errors[1] < 0.01
    covariance = np.array(calibration.actuator.baseline.covariance)  # type: ignore[union-attr]
    assert np.sqrt(covariance.diagonal()).max() <= math.log(1.1) / 2
