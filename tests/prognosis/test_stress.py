"""Stress covariates against closed forms of accelerated life, and exponents estimated from flights."""

import math

import numpy as np
import pytest

from emaphm.actuator import Actuator
from emaphm.actuator.requirements import Requirement
from emaphm.errors import PrognosisError
from emaphm.history import Flight
from emaphm.prognosis import (
    Evidence,
    Observation,
    Question,
    Stress,
    StressPiece,
    StressReference,
    fleet_prior,
    prognose,
)
from emaphm.prognosis.evidence import stress_pieces
from emaphm.prognosis.filter.following import follow
from emaphm.prognosis.notes.stress import stress_notes
from emaphm.prognosis.prior import NEW, Prior
from emaphm.prognosis.prognose import rul_forecasts
from emaphm.prognosis.settings import FilterSettings
from emaphm.prognosis.stress import ageing_ahead, exposure

WORN = Actuator.thesis().model_copy(
    update={"requirements": (Requirement(component="friction", at_most=0.6),)}
)
ERROR = 0.01
HEAVY, LIGHT = Stress(load=2.0), Stress(load=1.0)


def flown(
    exponent: float, *, count: int = 30, rate: float = 1e-4, unit: str = "S1", seed: int = 0
) -> Evidence:
    """Return a unit with alternating 50 h light and heavy; friction grows with a power of the load."""
    random = np.random.default_rng(seed)
    observations, pieces, level = [], [], 0.0
    for i in range(count):
        stress = HEAVY if i % 2 else LIGHT
        pieces.append(StressPiece(50.0 * i, 50.0 * (i + 1), stress))
        level += 50.0 * rate * float(stress.load or 0) ** exponent
        z = NEW + ERROR * random.standard_normal(8)
        z[0] += level
        observations.append(Observation(50.0 * (i + 1), z, ERROR**2 * np.eye(8), np.ones(8, bool)))
    return Evidence(unit, "P1", 50.0 * count, tuple(observations), stresses=tuple(pieces))


def test_the_exposure_of_recorded_hours_agrees_with_the_formula() -> None:
    reference = StressReference(load=0.5, temperature=290.0, cycles_per_hour=4.0)
    pieces = (StressPiece(0.0, 10.0, Stress(1.0, 310.0, 2.0)), StressPiece(20.0, 30.0, Stress(load=0.25)))
    p, b, g = 3.0, 0.5, 0.8
    aged = exposure(pieces, reference, 5.0, 40.0).aged(np.array([[p, b, g]]))
    by_hand = 5 * 2**p * math.exp(2 * b) * 0.5**g + 10 * 0.5**p + 20
    assert aged == pytest.approx(by_hand)


def test_the_reference_is_the_median_of_the_recorded_stress() -> None:
    pieces = [StressPiece(0, 1, Stress(load=x, temperature=300.0)) for x in (1.0, 2.0, 9.0)]
    assert StressReference.of(pieces) == StressReference(2.0, 300.0, None)
    assert StressReference(1.2345, 293.7, 0.04567).rounded() == StressReference(1.2, 294.0, 0.046)
    assert StressReference(None, None, 0.0).rounded() == StressReference(None, None, 0.0)
    assert StressReference.of([]) is None
    assert StressReference.of([StressPiece(0, 1, Stress(load=0.0))]) is None


@pytest.mark.parametrize("exponent", [0.0, 3.0])
def test_the_exponent_of_the_load_is_estimated_from_flights(exponent: float) -> None:
    evidence = flown(exponent) if exponent else flown(exponent, rate=6e-4, count=32)
    belief = follow(evidence, Prior(), seed=1, settings=FilterSettings(particles=400)).belief
    learnt = float(np.sum(belief.weights[:, 0] * belief.exponents[:, 0, 0]))
    assert learnt == pytest.approx(exponent, abs=0.9)  # prior: from 0 to 4, mean 2


@pytest.mark.usefixtures("few_steps")
def test_a_lighter_future_load_lengthens_the_rul() -> None:
    """Friction is 0.45 of 0.6 and grows with the load's cube: the rest takes 1,500 h light, 187 h heavy."""
    evidence = flown(3.0, count=20)
    prognosis = prognose(evidence, WORN, Question(ahead=HEAVY), keep_past=False)
    light, as_before = (
        np.median(rul_forecasts([prognosis.belief], evidence, WORN, ahead)[0][1]) for ahead in (LIGHT, None)
    )
    heavy = prognosis.median
    assert heavy == pytest.approx((0.6 - 0.45) / 8e-4, rel=0.3)
    assert heavy < as_before < light
    assert light > 3 * heavy


def test_covariates_missing_from_a_future_stress_stay_as_in_the_past() -> None:
    """10 of 30 h were warm and heavy, 20 h cold and light; the future load applies to both temperatures."""
    reference = StressReference(load=2.0, temperature=300.0)
    pieces = (
        StressPiece(0.0, 10.0, Stress(load=4.0, temperature=330.0)),
        StressPiece(10.0, 30.0, Stress(load=1.0, temperature=290.0)),
    )
    p, b = 2.0, 0.4
    exponents = np.array([p, b, 0.5])
    warmth = (10 * math.exp(3 * b) + 20 * math.exp(-b)) / 30
    past = (10 * 2**p * math.exp(3 * b) + 20 * 0.5**p * math.exp(-b)) / 30

    def ahead(stress: Stress | None, hours: float = 30.0) -> float:
        return float(ageing_ahead(pieces, reference, hours, exponents, stress))

    assert ahead(None) == pytest.approx(past)
    assert ahead(Stress(load=3.0)) == pytest.approx(1.5**p * warmth)
    assert ahead(Stress(load=3.0, temperature=310.0)) == pytest.approx(1.5**p * math.exp(b))
    assert ahead(Stress(cycles_per_hour=9.0)) == ahead(None)  # cycles were not recorded
    assert ahead(Stress()) == ahead(None)
    assert ahead(Stress(load=3.0), hours=0.0) == pytest.approx(1.5**p)
    assert ahead(None, hours=0.0) == 1.0


def test_a_mean_over_few_intervals_is_shrunk_towards_the_reference() -> None:
    """Two intervals of 10 h at twice and four times the load: the mean of ln(L / L_0) is 1.5 ln 2."""
    reference = StressReference(load=1.0)
    pieces = (StressPiece(0.0, 10.0, Stress(load=2.0)), StressPiece(10.0, 20.0, Stress(load=4.0)))
    exponents = np.array([2.0, 0.0, 0.0])

    def ahead(weight: float, stress: Stress | None = None) -> float:
        return float(ageing_ahead(pieces, reference, 20.0, exponents, stress, (weight, 0.0, 0.0)))

    assert ahead(0.0) == pytest.approx((2**2 + 4**2) / 2)
    # The weight of six intervals leaves a quarter of the mean.
    assert ahead(6.0) == pytest.approx(2 ** (-2 * 0.75 * 1.5) * (2**2 + 4**2) / 2)
    assert ahead(6.0, Stress(load=3.0)) == pytest.approx(3**2)


@pytest.mark.usefixtures("few_steps")
def test_a_future_stress_that_was_never_recorded_does_not_change_the_sample() -> None:
    evidence = flown(3.0, count=3)
    prior = Prior(reference=StressReference(load=0.5))
    as_before, cycles = (
        prognose(evidence, WORN, Question(ahead=ahead), prior=prior)
        for ahead in (None, Stress(cycles_per_hour=3.0))
    )
    assert np.array_equal(as_before.sample, cycles.sample)


@pytest.mark.usefixtures("few_steps")
def test_a_future_stress_without_records_is_not_used_and_is_noted() -> None:
    evidence = flown(1.0, count=2)
    plain = Evidence("S1", "P1", evidence.hours, evidence.observations)
    without_stress, with_stress = (prognose(plain, WORN, Question(ahead=ahead)) for ahead in (None, HEAVY))
    assert np.array_equal(without_stress.sample, with_stress.sample)
    assert (
        "not recorded in the history, and therefore not used in the future stress: load" in with_stress.notes
    )


def test_a_fleet_prior_has_the_exponents_and_the_reference_of_its_units() -> None:
    prior = fleet_prior([flown(3.0, count=20, unit=f"F{i}", seed=i) for i in range(2)])
    assert prior.reference == StressReference(load=1.5)
    assert prior.fleet is not None
    moving = prior.fleet.law[:, 0] > 0
    assert prior.fleet.exponents[moving, 0, 0].mean() == pytest.approx(3.0, abs=0.7)


def test_cycles_per_hour_follow_from_the_recorded_cycles_and_hours() -> None:
    flights = (
        Flight(100.0, 50, None, load=2.0),
        Flight(150.0, None, None, temperature=290.0),
        Flight(200.0, 250, None),
    )
    pieces = stress_pieces(flights)
    assert pieces == (
        StressPiece(0.0, 100.0, Stress(2.0, None, 0.5)),
        # 200 cycles in the 100 h since the last stated cycles; the flight in between states none.
        StressPiece(100.0, 150.0, Stress(None, 290.0, 2.0)),
        StressPiece(150.0, 200.0, Stress(None, None, 2.0)),
    )


def test_a_future_stress_far_from_the_recorded_values_is_noted() -> None:
    reference = StressReference(load=2.0, temperature=300.0)
    assert stress_notes(Stress(20.0, 350.0), reference) == []
    load, temperature = stress_notes(Stress(1e9, 400.0), reference)
    assert load == "far from the recorded values: of the future stress, load is taken as 10 × 2"
    assert temperature.endswith("temperature is taken as 50 K from 300 K")
    assert "0.1 × 2" in stress_notes(Stress(0.01), reference)[0]


@pytest.mark.parametrize("wrong", [{"load": -1.0}, {"temperature": 0.0}, {"cycles_per_hour": math.nan}])
def test_invalid_stress_values_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(PrognosisError):
        Stress(**wrong)
