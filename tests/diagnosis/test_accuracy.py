"""The accuracy that docs/accuracy.md publishes, on recordings of the reference model.

Each bound is a published figure with a margin for the scatter of fewer cases: about twice the published
median or mean, and a little more than the published worst case. `make study` has the figures themselves.
Most recordings are shorter than the published ones, to save time: they contain less information.
"""

import numpy as np
import pytest

from cases import THESIS, USUAL, covered, drawn, errors_percent, reference_recordings
from emaphm.actuator import NAMES, Chirp, Faults
from emaphm.diagnosis import Diagnosis, diagnose, error_percent
from emaphm.estimation.bias_correction import MAX_CORRECTIONS
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

Diagnoses = dict[int, list[Diagnosis]]
"""Diagnoses by the maximum number of correction iterations."""

DURATION, NOISY_DURATION = 0.25, 0.2
"""Durations of chirps without and with noise [s]; the published ones are 0.5 s."""

CORRECTIONS = (0, MAX_CORRECTIONS)
SINGLES = {
    "friction": Faults(friction=0.25),
    "backlash": Faults(backlash=0.75),
    "short_a": Faults(short_a=0.8),
    "eccentricity": Faults(eccentricity=0.25),
    "gain": Faults(gain=0.75),
}
"""Single faults of docs/physics.md, section 10, with one of two sizes of each."""

SINGLE_FAULTS = np.stack([faults.vector for faults in SINGLES.values()])
RANDOM_FAULTS = drawn(2, seed=0)
NOISY_FAULTS = drawn(3, seed=1)


def diagnosed(recordings: list[Recording]) -> Diagnoses:
    """Return diagnoses with known load and temperature, like the published cases without noise."""
    return {
        most: [diagnose(recording, THESIS, max_corrections=most, nuisances=()) for recording in recordings]
        for most in CORRECTIONS
    }


@pytest.fixture(scope="module")
def of_singles() -> Diagnoses:
    return diagnosed(reference_recordings(SINGLE_FAULTS, duration=DURATION))


@pytest.fixture(scope="module")
def of_random() -> Diagnoses:
    return diagnosed(reference_recordings(RANDOM_FAULTS, duration=DURATION))


@pytest.fixture(scope="module")
def of_noisy() -> Diagnoses:
    return diagnosed(reference_recordings(NOISY_FAULTS, noise=0.05, duration=NOISY_DURATION))


# Published: 0.24 / 0.79 % with, 0.70 / 1.63 % without correction. From eight other search seeds, without:
# 0.8 to 1.2 % and 1.6 to 3.4 %.
@pytest.mark.parametrize(("most", "mean", "worst"), [(MAX_CORRECTIONS, 0.4, 1.2), (0, 1.5, 4.0)])
def test_single_faults_are_estimated_as_published(
    of_singles: Diagnoses, most: int, mean: float, worst: float
) -> None:
    errors = errors_percent(SINGLE_FAULTS, of_singles[most])
    assert errors.mean() <= mean
    assert errors.max() <= worst


# Published: 0.20 / 1.30 % with, 2.29 / 9.78 % without correction; 0.31 / 2.58 % with noise.
@pytest.mark.parametrize(("most", "median", "worst"), [(MAX_CORRECTIONS, 0.4, 1.6), (0, 3.5, 11.0)])
def test_random_faults_are_estimated_as_published(
    of_random: Diagnoses, most: int, median: float, worst: float
) -> None:
    errors = errors_percent(RANDOM_FAULTS, of_random[most])
    assert np.median(errors) <= median
    assert errors.max() <= worst


@pytest.mark.evidence
def test_errors_with_sensor_noise_are_as_published(of_noisy: Diagnoses) -> None:
    errors = errors_percent(NOISY_FAULTS, of_noisy[MAX_CORRECTIONS])
    assert np.median(errors) <= 0.6
    assert errors.max() <= 3.0


def test_the_correction_reduces_the_mean_error(of_singles: Diagnoses, of_random: Diagnoses) -> None:
    for truths, diagnoses in ((SINGLE_FAULTS, of_singles), (RANDOM_FAULTS, of_random)):
        before, after = (errors_percent(truths, diagnoses[most]).mean() for most in CORRECTIONS)
        assert after < before / 2


@pytest.mark.parametrize("faulty", SINGLES)
def test_a_single_fault_is_separated_from_the_other_seven(of_singles: Diagnoses, faulty: str) -> None:
    diagnosis = of_singles[MAX_CORRECTIONS][list(SINGLES).index(faulty)]
    assert diagnosis.explained
    assert diagnosis.components[faulty].verdict == "degraded"
    for name, component in diagnosis.components.items():
        # The phase has the verdict of the eccentricity, and no meaning without eccentricity.
        if name not in (faulty, "eccentricity_phase"):
            assert component.verdict == "healthy"


# Phase a is one of the single faults above.
def test_shorts_are_located_in_their_phases() -> None:
    truth = Faults(short_b=0.3, short_c=0.15)
    recording = reference_recordings([truth.vector], noise=0.05, duration=NOISY_DURATION)[0]
    faults = diagnose(recording, THESIS, nuisances=USUAL).faults
    for name in ("short_a", "short_b", "short_c"):
        assert getattr(faults, name) == pytest.approx(getattr(truth, name), abs=0.02)


@pytest.fixture(scope="module")
def of_healthy() -> Diagnosis:
    """Return the diagnosis by all channels; test_nuisance_selection tests that nothing else is suspected."""
    healthy = simulate(THESIS, Chirp(duration=NOISY_DURATION), duration=NOISY_DURATION, noise=0.05)
    return diagnose(healthy, THESIS, nuisances=USUAL)


def test_a_healthy_actuator_is_called_healthy(of_healthy: Diagnosis) -> None:
    assert of_healthy.explained
    verdicts = {name: component.verdict for name, component in of_healthy.components.items()}
    assert verdicts == dict.fromkeys(NAMES, "healthy") | {"eccentricity_phase": "cannot tell"}
    assert error_percent(Faults().vector, of_healthy.faults.vector) <= 2.0


def test_the_phase_is_not_identifiable_without_eccentricity(
    of_healthy: Diagnosis, of_singles: Diagnoses
) -> None:
    for diagnosis in (of_healthy, of_singles[MAX_CORRECTIONS][list(SINGLES).index("short_a")]):
        phase = diagnosis.components["eccentricity_phase"]
        assert not phase.identifiable
        assert phase.interval95 == (0.0, 1.0)
        assert "eccentricity" in phase.reason


@pytest.mark.parametrize("true", [pytest.param(0.02, marks=pytest.mark.evidence), 0.98])
def test_the_phase_is_estimated_across_the_cut_of_its_circle(true: float) -> None:
    truth = Faults(eccentricity=0.5, eccentricity_phase=true)
    recording = reference_recordings([truth.vector], noise=0.05, duration=NOISY_DURATION)[0]
    diagnosis = diagnose(recording, THESIS, nuisances=USUAL)
    assert error_percent(truth.vector, diagnosis.faults.vector) <= 2.0
    assert covered(truth.vector, diagnosis)[6]


@pytest.mark.parametrize(("most", "least"), [(MAX_CORRECTIONS, 0.87), (0, 0.8)])
def test_intervals_have_the_published_coverage(of_noisy: Diagnoses, most: int, least: float) -> None:
    inside = np.array([covered(k, d) for k, d in zip(NOISY_FAULTS, of_noisy[most], strict=True)])
    # Published by component: 93 to 97 %. Fewer than 87 % of 24 independent 95 % intervals hold the truth once
    # in thirty times. Without correction, bias reduces the coverage to 92 %, unequal between components.
    assert inside.mean() >= least
    assert np.all(inside.mean(axis=0) >= 0.5)


def test_intervals_are_as_narrow_as_required(of_noisy: Diagnoses) -> None:
    # Otherwise intervals of any width would pass the previous test.
    for most, widest in ((0, 0.1), (MAX_CORRECTIONS, 0.02)):
        components = [component for d in of_noisy[most] for component in d.components.values()]
        widths = [np.ptp(component.interval95) for component in components if component.identifiable]
        assert len(widths) >= 0.95 * len(components)
        assert np.median(widths) <= widest


def test_every_recording_of_the_reference_model_is_explained(
    of_singles: Diagnoses, of_random: Diagnoses
) -> None:
    for diagnoses in (of_singles, of_random):
        assert all(d.explained for most in CORRECTIONS for d in diagnoses[most])


MULTIPLE = Faults.from_vector([0.25, 0.75, 0.8, 0.8, 0.8, 0.25, 0.5, 0.75])
"""Multiple faults of the thesis, whose dragonfly had an error of 64.2 % (docs/physics.md, section 10)."""


@pytest.mark.evidence
def test_the_thesiss_multiple_faults_are_estimated_as_published() -> None:
    diagnosis = diagnose(reference_recordings([MULTIPLE.vector], duration=DURATION)[0], THESIS, nuisances=())
    # Published: at worst 0.90 % in ten searches, and 1.12 % in ten recordings.
    assert error_percent(MULTIPLE.vector, diagnosis.faults.vector) <= 1.5
    assert diagnosis.explained


def test_a_threefold_inertia_is_not_explained_by_faults() -> None:
    mechanics = THESIS.mechanics
    heavy = mechanics.model_copy(
        update={"inertia_motor": 3 * mechanics.inertia_motor, "inertia_user": 3 * mechanics.inertia_user}
    )
    for noise in (0.0, 0.5):
        recording = simulate(
            THESIS.model_copy(update={"mechanics": heavy}),
            Chirp(duration=DURATION),
            duration=DURATION,
            noise=noise,
        )
        assert not diagnose(recording, THESIS, max_corrections=0).explained


def test_an_unrecorded_oscillating_load_is_not_explained() -> None:
    whole = simulate(
        THESIS,
        Chirp(duration=DURATION),
        duration=DURATION,
        load=lambda t: 0.2 * np.sin(2 * np.pi * 30 * t),
    )
    assert diagnose(whole, THESIS, max_corrections=0).explained
    unknown = Recording({name: whole[name] for name in whole if name != "load_Nm"})
    diagnosis = diagnose(unknown, THESIS, max_corrections=0)
    assert not diagnosis.explained
    assert "does NOT explain" in str(diagnosis)
