"""A scale error of one phase's current sensor in the drive, which appears as a short of that phase."""

from collections.abc import Mapping

from emaphm.diagnosis.verdict import Estimate
from emaphm.estimation.problem import Problem
from emaphm.estimation.space.parameter_space import SHORTS
from emaphm.recording.schema import PHASES

USUAL = 0.05
"""Largest usual scale error of a current sensor over temperature and life; at first it is 1 to 2 %."""


def sensor_may_appear_as_short(components: Mapping[str, Estimate], problem: Problem) -> tuple[str, ...]:
    """Return a note if a usual scale error of the sensor of a phase would explain its degraded short.

    A sensor that reads too high reduces the current of its phase, and so the torque and the voltage drop for
    the same `current_A`, as a short does. With the sensor of phase a reading 2, 3 and 5 % too high, a short
    of 0.016, 0.027 and 0.052 was estimated from current and line voltage, each within ± 0.006. The sum of
    recorded phase currents shows such an error.
    """
    if not problem.actuator.three_phases or all(name in problem.measured for name in PHASES):
        return ()
    return tuple(
        f"a current sensor of phase {name[-1]} in the drive that reads {100 * components[name].value:.2g} % "
        f"too high would have nearly the same effect as {name}: compare the sensors of the three phases, or "
        "record the phase currents, whose sum shows it"
        for name in SHORTS
        if components[name].verdict == "degraded" and components[name].interval95[0] <= USUAL
    )
