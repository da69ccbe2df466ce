"""Load-dependent friction, which appears as a fault of a unit that was calibrated under another load."""

from collections.abc import Mapping

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.quantity import unit_for
from emaphm.diagnosis.verdict import Estimate
from emaphm.estimation.search_result import SearchResult

USUAL = 0.3
"""Largest usual friction of a ball screw or gear, relative to its load."""

LAW = "load-dependent"


def load_may_be_friction(components: Mapping[str, Estimate], result: SearchResult) -> tuple[str, ...]:
    """Return a note if usual load-dependent friction would explain a calibrated unit's degraded friction.

    A healthy screw whose friction was 10 % of the load, calibrated under 0.12 N·m, had a friction of 0.114 ±
    0.001 under 0.35 N·m: one load does not separate the two.
    """
    objective, actuator = result.objective, result.objective.problem.actuator
    if actuator.baseline is None or components["friction"].verdict != "degraded" or _is_described(actuator):
        return ()
    estimated = objective.space.nuisance_values(result.point[np.newaxis]).get("load", np.zeros(1))
    recorded = objective.problem.inputs.rows(objective.problem.inputs.load)
    described = actuator.mechanics.offset
    calibrated = np.abs(actuator.baseline.loads or (described,))
    load = abs(described + float(estimated[0]) + float(np.mean(recorded)))
    excess_load = load - float(np.clip(load, calibrated.min(), calibrated.max()))
    excess_friction = (
        components["friction"].value * actuator.faults.friction * actuator.mechanics.dynamic_friction
    )
    if not excess_load or not 0 < excess_friction / excess_load <= USUAL:
        return ()
    unit = unit_for("N·m", actuator.coordinates)
    note = (
        f"friction that is {100 * excess_friction / excess_load:.2g} % of the load has the same effect: the "
        "load is "
        f"{abs(excess_load):.3g} {unit} {'larger' if excess_load > 0 else 'smaller'} in size than any of the "
        "calibration; "
        f"calibrate under several loads with the law {LAW} (--laws {LAW})"
    )
    return (note,)


def _is_described(actuator: Actuator) -> bool:
    """Return whether the description has load-dependent friction."""
    friction = actuator.friction
    return friction is not None and (friction.load_friction or friction.load_external) is not None
