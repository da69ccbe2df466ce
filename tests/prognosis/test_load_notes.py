"""A friction that goes with the estimated load is said to; wear under loads by chance is not."""

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
        seen = NEW + ERROR * random.standard_normal(8)
        seen[0] += level
        estimated = None if load is None else float(load[i])
        observations.append(
            Observation(100.0 * (i + 1), seen, ERROR**2 * np.eye(8), np.ones(8, bool), load=estimated)
        )
    return Evidence("S1", "P1", 100.0 * friction.size, tuple(observations))


@pytest.mark.parametrize("share", [1.5, -1.5])
def test_friction_of_the_load_is_said(share: float) -> None:
    load = np.array([-0.06, 0.05, -0.02, 0.075, 0.0, 0.03, -0.04])
    (note,) = load_notes(diagnosed(share * load, load))
    assert "correlation" in note
    assert "of 7" in note
    assert "load-dependent" in note


def test_wear_under_loads_by_chance_is_none() -> None:
    for seed in range(200):
        load = np.random.default_rng(seed).uniform(-0.2, 0.2, 12)
        assert load_notes(diagnosed(np.linspace(0, 0.4, 12), load, seed)) == []


def test_nothing_is_said_of_few_of_a_steady_friction_or_of_the_part_before() -> None:
    load = np.array([-0.06, 0.05, -0.02, 0.075, 0.0, 0.03, -0.04])
    assert load_notes(diagnosed(1.5 * load[:4], load[:4])) != []
    assert load_notes(diagnosed(1.5 * load[:3], load[:3])) == []
    assert load_notes(diagnosed(0 * load, load)) == []
    assert load_notes(diagnosed(1.5 * load, None)) == []
    renewed = replace(diagnosed(1.5 * load, load), replacements=((400.0, "friction"),))
    assert load_notes(renewed) == []


@pytest.mark.parametrize("seed", range(5))
def test_friction_of_a_tenth_of_the_load_is_said_of_six_diagnoses(seed: int) -> None:
    """Of a machine with 0.1 N·m of dry friction, which a friction k multiplies by 1 + 2 k."""
    load = np.random.default_rng(seed).permutation(np.linspace(0, 0.5, 6))
    coulomb = 0.1
    assert load_notes(diagnosed(0.1 * load / (2 * coulomb), load, seed)) != []


@pytest.mark.parametrize("count", [4, 6, 12])
@pytest.mark.parametrize("where", [0, -1])
def test_a_single_diagnosis_under_load_with_wear_is_no_rule(count: int, where: int) -> None:
    """The loads of the others are those of a free shaft, to the error of their estimates."""
    for seed in range(50):
        load = 1e-4 * np.random.default_rng(seed).standard_normal(count)
        friction = np.zeros(count)
        load[where], friction[where] = 0.05, 0.06
        assert load_notes(diagnosed(friction, load, seed)) == []


def test_wear_between_two_campaigns_under_different_loads_is_no_rule() -> None:
    load = np.array([0.0, 0.001, -0.001, 0.1, 0.101, 0.099])
    assert load_notes(diagnosed(np.array([0.0, 0.0, 0.0, 0.2, 0.2, 0.2]), load)) == []
