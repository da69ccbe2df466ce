"""How near a diagnosis comes to the truth, on recordings of the reference model; `make study` has the rest.

The thresholds are those of the accuracy that is promised: single faults 2 % in the mean, random vectors
2.5 % in the median. docs/physics.md, section 10 has what the thesis's optimisers reached.
"""

import numpy as np
import pytest

from cases import (
    SINGLES,
    THESIS,
    covered,
    drawn,
    errors_percent,
    reference_recordings,
)
from emaphm.actuator import NAMES, Chirp, Faults
from emaphm.diagnosis import Diagnosis, diagnose, error_percent
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

Diagnoses = dict[int, list[Diagnosis]]
"""By the turns of correction."""

TURNS = (0, 3)
SINGLE_FAULTS = np.stack([faults.vector for faults in SINGLES.values()])
RANDOM_FAULTS = drawn(12, seed=0)
NOISY_FAULTS = drawn(20, seed=1)


def diagnosed(recordings: list[Recording]) -> Diagnoses:
    return {turns: [diagnose(one, THESIS, max_corrections=turns) for one in recordings] for turns in TURNS}


@pytest.fixture(scope="module")
def of_singles(singles: list[Recording]) -> Diagnoses:
    return diagnosed(singles)


@pytest.fixture(scope="module")
def of_random() -> Diagnoses:
    return diagnosed(reference_recordings(RANDOM_FAULTS))


@pytest.fixture(scope="module")
def of_noisy() -> Diagnoses:
    return diagnosed(reference_recordings(NOISY_FAULTS, noise=0.05))


@pytest.mark.parametrize("turns", TURNS)
def test_single_faults_are_found_to_two_percent_in_the_mean(of_singles: Diagnoses, turns: int) -> None:
    assert errors_percent(SINGLE_FAULTS, of_singles[turns]).mean() <= 2.0


@pytest.mark.parametrize("turns", TURNS)
def test_random_faults_are_found_to_two_and_a_half_percent_in_the_median(
    of_random: Diagnoses, turns: int
) -> None:
    errors = errors_percent(RANDOM_FAULTS, of_random[turns])
    assert np.median(errors) <= 2.5
    # The 95th percentile of so few is between the two largest: 6 % is promised, 2 % with the correction.
    assert np.sort(errors)[-2] <= (2.0 if turns else 6.0)


def test_the_correction_does_not_worsen_the_mean(of_singles: Diagnoses, of_random: Diagnoses) -> None:
    for truths, found in ((SINGLE_FAULTS, of_singles), (RANDOM_FAULTS, of_random)):
        before, after = (errors_percent(truths, found[turns]).mean() for turns in TURNS)
        assert after <= before


@pytest.mark.parametrize("case", SINGLES)
def test_a_single_fault_is_told_from_the_other_seven(of_singles: Diagnoses, case: str) -> None:
    faulty = case.partition("=")[0]
    found = of_singles[3][list(SINGLES).index(case)]
    assert found.explained
    assert found.components[faulty].verdict == "degraded"
    for name, component in found.components.items():
        # The phase shares the verdict of the eccentricity, and has no meaning without.
        if name not in (faulty, "eccentricity_phase"):
            assert component.verdict == "healthy"


@pytest.mark.parametrize("phase", ["short_a", "short_b", "short_c"])
def test_a_short_is_located_in_its_phase(phase: str) -> None:
    truth = Faults.from_mapping({phase: 0.3})
    found = diagnose(reference_recordings([truth.vector], noise=0.05)[0], THESIS).faults
    for name in ("short_a", "short_b", "short_c"):
        assert getattr(found, name) == pytest.approx(getattr(truth, name), abs=0.02)


def test_a_healthy_actuator_is_healthy(healthy: Recording) -> None:
    found = diagnose(healthy, THESIS)
    assert found.explained
    verdicts = {name: component.verdict for name, component in found.components.items()}
    assert verdicts == dict.fromkeys(NAMES, "healthy") | {"eccentricity_phase": "cannot tell"}
    assert error_percent(Faults().vector, found.faults.vector) <= 2.0


def test_the_phase_cannot_be_known_without_eccentricity(healthy: Recording, shorted: Recording) -> None:
    for recording in (healthy, shorted):
        phase = diagnose(recording, THESIS).components["eccentricity_phase"]
        assert not phase.identifiable
        assert phase.interval95 == (0.0, 1.0)
        assert "eccentricity" in phase.reason


@pytest.mark.parametrize("true", [0.02, 0.98])
def test_the_phase_is_found_across_the_cut_of_its_circle(true: float) -> None:
    truth = Faults(eccentricity=0.5, eccentricity_phase=true)
    found = diagnose(reference_recordings([truth.vector], noise=0.05)[0], THESIS)
    assert error_percent(truth.vector, found.faults.vector) <= 2.0
    assert covered(truth.vector, found)[6]


@pytest.mark.parametrize("turns", TURNS)
def test_intervals_hold_the_truth_as_often_as_they_should(of_noisy: Diagnoses, turns: int) -> None:
    inside = np.array([covered(k, d) for k, d in zip(NOISY_FAULTS, of_noisy[turns], strict=True)])
    # Of 100 such cases 98 % hold it with the correction and 92 % without; the promise is 75 %.
    assert inside.mean() >= 0.75
    assert np.all(inside.mean(axis=0) >= 0.5)


def test_intervals_are_no_wider_than_they_need_to_be(of_noisy: Diagnoses) -> None:
    # Otherwise the last test could be passed by knowing nothing.
    for turns, widest in ((0, 0.1), (3, 0.05)):
        components = [component for d in of_noisy[turns] for component in d.components.values()]
        widths = [np.ptp(component.interval95) for component in components if component.identifiable]
        assert len(widths) >= 0.95 * len(components)
        assert np.median(widths) <= widest


def test_every_explained_recording_says_so(of_singles: Diagnoses, of_random: Diagnoses) -> None:
    for found in (of_singles, of_random):
        assert all(d.explained for turns in TURNS for d in found[turns])


MULTIPLE = Faults.from_vector([0.25, 0.75, 0.8, 0.8, 0.8, 0.25, 0.5, 0.75])
"""The multiple faults of the thesis, where its dragonfly was 64.2 % off (docs/physics.md, section 10)."""


@pytest.fixture(scope="module")
def of_multiple() -> Diagnosis:
    return diagnose(reference_recordings([MULTIPLE.vector])[0], THESIS)


def test_multiple_faults_are_found_better_than_by_the_thesis(of_multiple: Diagnosis) -> None:
    assert error_percent(MULTIPLE.vector, of_multiple.faults.vector) < 64.2


def test_multiple_faults_are_found_or_not_said_to_be_explained(of_multiple: Diagnosis) -> None:
    found = error_percent(MULTIPLE.vector, of_multiple.faults.vector)
    assert found <= 10.0 or not of_multiple.explained


def test_a_threefold_inertia_is_no_fault_that_the_model_knows() -> None:
    mechanics = THESIS.mechanics
    heavy = mechanics.model_copy(
        update={"inertia_motor": 3 * mechanics.inertia_motor, "inertia_user": 3 * mechanics.inertia_user}
    )
    for noise in (0.0, 0.5):
        recording = simulate(THESIS.model_copy(update={"mechanics": heavy}), Chirp(), noise=noise)
        assert not diagnose(recording, THESIS, max_corrections=0).explained


def test_a_load_that_nobody_recorded_is_not_explained() -> None:
    whole = simulate(THESIS, Chirp(), load=lambda t: 0.2 * np.sin(2 * np.pi * 30 * t))
    assert diagnose(whole, THESIS, max_corrections=0).explained
    unknown = Recording({name: whole[name] for name in whole if name != "load_Nm"})
    found = diagnose(unknown, THESIS, max_corrections=0)
    assert not found.explained
    assert "does NOT explain" in str(found)
