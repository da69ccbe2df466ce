"""A rotor whose electrical zero is not where the position's zero puts it contradicts what is estimated."""

import re

import numpy as np
import pytest

from cases import THESIS, on_a_rig
from emaphm.actuator import Faults
from emaphm.diagnosis.explanation.rotor_zero import contradicted_zero
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.problem import Problem
from emaphm.estimation.uncertainty.local_covariance import jacobians_at
from emaphm.recording import Recording

TURNED_RAD = 0.12
"""Electrical."""


def contradicted(recording: Recording, faults: Faults) -> tuple[str, ...]:
    """Return what contradicts the zero at the estimate next to the true `faults`."""
    problem = Problem.of(recording, THESIS, channels=("current_A", "voltage_V"))
    objective = faults_objective(problem, ("load",))
    result = correct_bias(objective, objective.space.points(faults.vector[np.newaxis]), 2, seed=0)
    jacobians = jacobians_at(objective, result.point, np.random.default_rng(0))
    return contradicted_zero(result, jacobians, seed=0)


@pytest.mark.parametrize("faults", [Faults(short_b=0.3), Faults(0.3, 0.2, 0.1, 0.4, 0.2, 0.3, 0.6, 0.6)])
def test_a_zero_that_is_off_shows_where_phases_differ(faults: Faults) -> None:
    recording = on_a_rig(THESIS, faults, 0.3)
    assert contradicted(recording, faults) == ()
    electrical = THESIS.electrical
    assert electrical is not None
    # The rotor stands where it stood; the command says that it is elsewhere.
    away = -TURNED_RAD / electrical.pole_pairs * THESIS.mechanics.gear_ratio
    moved = Recording({**recording.channels, "command_rad": recording["command_rad"] + away})
    (reason,) = contradicted(moved, faults)
    found = re.search(r"zero seems to be (\S+) rad", reason)
    assert found is not None
    assert float(found[1]) == pytest.approx(TURNED_RAD, rel=0.25)


def test_healthy_phases_do_not_show_it() -> None:
    recording = on_a_rig(THESIS, Faults(friction=0.2), 0.3)
    moved = Recording({**recording.channels, "command_rad": recording["command_rad"] + 1e-3})
    assert contradicted(moved, Faults(friction=0.2)) == ()
