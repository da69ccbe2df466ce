"""Notes on friction that is correlated with the estimated load; wear under random loads is not noted."""

from dataclasses import replace

import numpy as np
import pytest

from emaphm.arrays import Array
from emaphm.prognosis import Evidence, Observation
from emaphm.prognosis.notes.loads import load_notes
from emaphm.prognosis.prior import NEW

ERROR = 0.003


def diagnosed(friction: Array, load: Array | None, seed: int = 0) -> Evidence:
    random = np.random.default_rng(seed)
    observations = []
    for i, level in enumerate(friction.tolist()):
        estimate = NEW + ERROR * random.standard_normal(8)
        estimate[0] += level
        estimated = None if load is None else float(load[i])
        observations.append(
            Observation(100.0 * (i + 1), estimate, ERROR**2 * np.eye(8), np.ones(8, bool), load=estimated)
        )
    return Evidence("S1", "P1", 100.0 * friction.size, tuple(observations))


@pytest.mark.parametrize("share", [1.5, -1.5])
def test_friction_that_is_correlated_with_the_load_is_noted(share: float) -> None:
    load = np.array([-0.06, 0.05, -0.02, 0.075, 0.0, 0.03, -0.04])
    (note,) = load_notes(diagnosed(share * load, load))
    assert "correlation" in note
    assert "of 7" in note
    assert "load-dependent" in note


def test_wear_under_random_loads_is_not_noted() -> None:
    for seed in range(200):
        load = np.random.default_rng(seed).uniform(-0.2, 0.2, 12)
        assert load_notes(diagnosed(np.linspace(0, 0.4, 12), load, seed)) == []


def test_few_diagnoses_steady_friction_and_a_replaced_part_are_not_noted() -> None:
    load = np.array([-0.06, 0.05, -0.02, 0.075, 0.0, 0.03, -0.04])
    assert load_notes(diagnosed(1.5 * load[:4], load[:4])) != []
    assert load_notes(diagnosed(1.5 * load[:3], load[:3])) == []
    assert load_notes(diagnosed(0 * load, load)) == []
    assert load_notes(diagnosed(1.5 * load, None)) == []
    renewed = replace(diagnosed(1.5 * load, load), replacements=((400.0, "friction"),))
    assert load_notes(renewed) == []


@pytest.mark.parametrize("seed", range(5))
def test_friction_of_a_tenth_of_the_load_is_noted_from_six_diagnoses(seed: int) -> None:
    """The machine has 0.1 N·m of dry friction; a friction level k multiplies it by 1 + 2 k."""
    load = np.random.default_rng(seed).permutation(np.linspace(0, 0.5, 6))
    coulomb = 0.1
    assert load_notes(diagnosed(0.1 * load / (2 * coulomb), load, seed)) != []


@pytest.mark.parametrize("count", [4, 6, 12])
@pytest.mark.parametrize("where", [0, -1])
def test_a_single_diagnosis_with_both_load_and_wear_is_not_noted(count: int, where: int) -> None:
    """The loads of the other diagnoses are zero within the error of their estimates."""
    for seed in range(50):
        load = 1e-4 * np.random.default_rng(seed).standard_normal(count)
        friction = np.zeros(count)
        load[where], friction[where] = 0.05, 0.06
        assert load_notes(diagnosed(friction, load, seed)) == []


def test_wear_between_two_campaigns_with_different_loads_is_not_noted() -> None:
    load = np.array([0.0, 0.001, -0.001, 0.1, 0.101, 0.099])
    assert load_notes(diagnosed(np.array([0.0, 0.0, 0.0, 0.2, 0.2, 0.2]), load)) == []
