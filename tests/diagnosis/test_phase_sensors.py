"""Errors of the drive's phase current sensors that appear as a short or as a torque ripple have a note."""

from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.arrays import Array
from emaphm.diagnosis.explanation.phase_sensors import sensor_may_appear_as_short
from emaphm.diagnosis.nuisance_estimate import NuisanceEstimate
from emaphm.diagnosis.text import on_ripple
from emaphm.diagnosis.verdict import estimates
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.recording import Recording
from emaphm.recording.schema import PHASES
from emaphm.simulated_recording import simulate

WHOLE = simulate(THESIS, Chirp(), model="averaged", noise=0.05, duration=0.3)
COLUMNS = {name: WHOLE[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")}


def sensor_notes(
    actuator: Actuator, short: float, standard_error: float, columns: Mapping[str, Array]
) -> Sequence[str]:
    """Return the notes on phase current sensors, for this estimate of the short of phase b."""
    objective = faults_objective(problem_of(Recording(columns), actuator, channels=None), None)
    space = objective.space
    point = space.points(Faults(short_b=short).vector)
    components = estimates(space, point, standard_error**2 * np.eye(space.dimensions), ())
    return sensor_may_appear_as_short(components, objective.problem)


@pytest.mark.parametrize("short", [0.027, 0.05])
def test_a_small_short_may_be_a_scale_error_of_the_current_sensor_of_its_phase(short: float) -> None:
    (note,) = sensor_notes(THESIS, short, 0.002, COLUMNS)
    assert f"current sensor of phase b in the drive that reads {100 * short:.2g} % too high" in note


@pytest.mark.parametrize(
    ("actuator", "short", "standard_error"),
    [(THESIS, 0.2, 0.002), (THESIS, 0.01, 0.002), (THESIS, 0.0, 0.002), (THESIS, 0.05, 0.2)],
)
def test_a_large_or_healthy_short_is_not_attributed_to_a_sensor(
    actuator: Actuator, short: float, standard_error: float
) -> None:
    assert len(sensor_notes(actuator, short, standard_error, COLUMNS)) == 0


def test_recorded_phase_currents_exclude_a_scale_error_of_a_phase() -> None:
    reference = simulate(THESIS, Chirp(), noise=0.05, duration=0.1)
    names = ("time_s", "command_rad", "angle_rad", *PHASES)
    assert len(sensor_notes(THESIS, 0.03, 0.002, {name: reference[name] for name in names})) == 0


@pytest.mark.parametrize(("sine", "named"), [(0.009, True), (0.0002, False)])
def test_a_ripple_once_per_electrical_turn_may_be_due_to_zeros_of_current_sensors(
    sine: float, named: bool
) -> None:
    none = {
        f"ripple{i}_{part}": NuisanceEstimate(0.0, 1e-4, "N·m", known=True)
        for i in range(1, 6)
        for part in ("cos", "sin")
    }
    assert list(on_ripple({}, THESIS)) == []
    of_electrical_turn = {"ripple2_sin": NuisanceEstimate(sine, 1e-4, "N·m", known=True)}
    orders, *cause = on_ripple(none | of_electrical_turn, THESIS)
    assert orders == "ripple1 to ripple5 have 1, 2, 4, 12 and 24 periods per turn of the motor."
    assert [note.startswith("ripple2, once per electrical turn, ") for note in cause] == [True] * named
