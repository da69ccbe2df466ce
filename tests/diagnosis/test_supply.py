"""A deviating supply is estimated from the ripple, and a described one is not changed."""

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.laws import LAWS
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.actuator.unit.tolerances import Tolerances
from emaphm.arrays import Array
from emaphm.diagnosis import Diagnosis, diagnose, error_percent
from emaphm.diagnosis.selection.laws.law_fit import with_law
from emaphm.diagnosis.selection.supply.supply_profile import SUPPLY_SCAN, SupplyProfile
from emaphm.diagnosis.selection.supply.supply_scan import is_scanned
from emaphm.errors import RecordingError
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.space.nuisances import Located, NuisanceSet
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

SHOWN = ("time_s", "command_rad", "current_A", "voltage_V")
FAULTS = Faults(0.95, 0.5, 0.5, 0.05, 0.35, 0.35, 0.25, 0.25)
"""With these faults, all tested supplies were found; with small friction, some are explained without one."""

ROWS = 2500


def recorded(supply: float, *, duration: float = 0.25) -> Recording:
    assert THESIS.electrical is not None
    present = with_lumped_parameters(THESIS, {"supply": (1 + supply) * THESIS.electrical.supply})
    command = Chirp(duration=duration)
    whole = simulate(present, command, faults=FAULTS, duration=duration, noise=0.05, adc_bits=12)
    return Recording({name: whole[name] for name in SHOWN})


def check(diagnosis: Diagnosis, supply: float) -> None:
    estimate = diagnosis.nuisances["supply"]
    assert abs(estimate.value - supply) <= max(SUPPLY_SCAN.step, 3 * estimate.standard_error)
    assert estimate.known
    assert diagnosis.explained
    assert error_percent(FAULTS.vector, diagnosis.faults.vector) < 1.0
    assert f"supply {estimate}" in str(diagnosis)


def test_a_deviating_supply_is_selected() -> None:
    diagnosis = diagnose(recorded(-0.1), THESIS, workers=2)
    assert diagnosis.selected == ("supply",)
    assert diagnosis.to_dict()["suspected"] == ["supply"]
    check(diagnosis, -0.1)


def test_no_supply_is_selected_where_the_inductance_has_a_tolerance() -> None:
    # The slope of the ripple is voltage by inductance: it does not identify which of the two deviates.
    unit = THESIS.model_copy(update={"tolerances": Tolerances(inductance=0.2)})
    diagnosis = diagnose(recorded(-0.1, duration=0.3), unit, workers=2)
    assert "supply" not in diagnosis.selected
    assert diagnosis.explained
    for name, (low, high) in diagnosis.interval.items():
        assert low - 0.01 <= getattr(FAULTS, name) <= high + 0.01


@pytest.mark.evidence
def test_a_named_supply_is_located() -> None:
    diagnosis = diagnose(recorded(-0.1), THESIS, nuisances=("load", "temperature", "supply"), workers=2)
    assert diagnosis.selected == ()
    check(diagnosis, -0.1)


def test_a_recorded_supply_is_known() -> None:
    whole = recorded(-0.1)
    assert THESIS.electrical is not None
    supply = 0.9 * THESIS.electrical.supply + np.random.default_rng(1).normal(0.0, 0.5, whole.samples)
    diagnosis = diagnose(whole.with_channels({**whole.channels, "supply_V": supply}), THESIS, workers=2)
    assert diagnosis.selected == ()
    assert "supply" not in diagnosis.nuisances
    assert diagnosis.explained
    assert error_percent(FAULTS.vector, diagnosis.faults.vector) < 1.0


def test_a_recorded_supply_that_is_not_positive_is_refused() -> None:
    whole = recorded(0.0, duration=0.1)
    spoilt = whole.with_channels({**whole.channels, "supply_V": np.full(whole.samples, -48.0)})
    with pytest.raises(RecordingError, match=r"supply_V is -48 V on average.*leave that column out"):
        diagnose(spoilt, THESIS)


def test_an_added_law_keeps_the_located_supply() -> None:
    nuisances = NuisanceSet.of(THESIS, ("load", "supply"), (), located={"supply": Located(-0.1, 0.01)})
    objective = MapObjective.of(
        problem_of(recorded(-0.1, duration=0.1), THESIS), ParameterSpace.of(THESIS, nuisances)
    )
    extended = with_law(objective, LAWS["stribeck"])
    assert extended.space.nuisances.located == nuisances.located
    nominal = np.zeros((1, extended.space.dimensions))
    assert extended.space.nuisance_values(nominal)["supply"] == pytest.approx(-0.1)


def profile(powers: Array) -> SupplyProfile:
    steps = [0, *(k for k in range(-6, 7) if k)]
    return SupplyProfile(SUPPLY_SCAN.step * np.array(steps, float), powers, 0.05, ROWS)


def test_a_profile_without_a_minimum_gives_the_prior() -> None:
    flat = profile(np.ones(13))
    located, share = flat.located
    assert located.value == pytest.approx(0.0, abs=1e-15)
    assert share == 1.0
    # A normal distribution of 5 %, in steps of 2 % and cut at 12 %: its variance within ±2.4 deviations.
    assert located.deviation == pytest.approx(0.046, abs=0.003)
    assert not flat.promising


def test_a_significant_minimum_locates_the_supply() -> None:
    powers = np.ones(13)
    powers[2] = 0.6
    located, share = profile(powers).located
    assert located.value == pytest.approx(-0.1, abs=1e-6)
    assert share == pytest.approx(0.6)
    # All other values are improbable: a uniform distribution within a step remains.
    assert located.deviation == pytest.approx(SUPPLY_SCAN.step / 12**0.5, rel=0.05)
    assert profile(powers).promising


def test_a_supply_is_located_between_two_equal_minima() -> None:
    powers = np.ones(13)
    powers[2] = powers[3] = 0.7
    located, _ = profile(powers).located
    # The smaller deviation, 1.6 standard deviations of the prior, is more probable than the other, 2.
    other = np.exp((1.6**2 - 2.0**2) / 2)
    assert located.value == pytest.approx((-0.08 - 0.1 * other) / (1 + other), abs=1e-4)


def test_a_random_minimum_leaves_the_supply_uncertain() -> None:
    powers = np.ones(13)
    powers[2] = 0.95
    located, _ = profile(powers).located
    assert abs(located.value) < SUPPLY_SCAN.certain * located.deviation


def test_only_a_drive_with_hysteresis_has_its_supply_scanned() -> None:
    for actuator, scanned in ((THESIS, True), (Actuator.pmsm(), False)):
        assert is_scanned(actuator) == scanned
