"""Conducting pair of phases of an equivalent winding, and the equivalent current of its current."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from emaphm.simulation.engine.structure import Structure
from emaphm.simulation.laws.angles import phase_angles
from emaphm.simulation.laws.commutation import of_idle_phase, trapezoid
from emaphm.simulation.laws.phases import Phases
from emaphm.simulation.laws.sensed_commutation import early_by_turning, of_sensed_idle_phase, over_a_turn

NUMBERS = Phases(0.0, 1.0, 2.0)
"""Numbers of the idle phases a, b, c in a kernel's state."""


class ConductingPair(NamedTuple):
    """Functions of the conducting pair, by the angle of the rotor or by Hall sensors with position errors."""

    of_idle: Callable[..., Any]
    """(state, parameters, three values): the value of the phase that idles at the start of the step."""
    mean: Callable[..., Any]
    """(state, parameters, step [s], three values): mean over the step of the value of the idle phase."""
    shown: Callable[..., Any]
    """(state, parameters, step [s], current of the pair): equivalent current."""


def conducting_pair(structure: Structure) -> ConductingPair:
    """Return the functions of the conducting pair for an actuator of this structure."""
    return _BY_HALL_SENSORS if structure.commutation else _BY_ANGLE


def _of_idle(s: Any, p: Any, values: Phases) -> Any:  # noqa: ARG001
    return of_idle_phase(s.electrical, values)


def _of_idle_throughout(s: Any, p: Any, step: Any, values: Phases) -> Any:  # noqa: ARG001
    return of_idle_phase(s.electrical, values)


def _pair_current(s: Any, p: Any, step: Any, current: Any) -> Any:  # noqa: ARG001
    return current


def _of_sensed_idle(s: Any, p: Any, values: Phases) -> Any:
    return of_sensed_idle_phase(s.electrical, values, _early(s, p))


def _mean(s: Any, p: Any, step: Any, values: Phases) -> Any:
    return over_a_turn(s.electrical, p.pole_pairs * s.speed * step, values, _early(s, p))


def _early(s: Any, p: Any) -> Any:
    return early_by_turning(
        Phases.of(p, "hall"), p.pole_pairs * s.speed, p.commutation_lag, p.commutation_delay
    )


def _by_shape(s: Any, p: Any, step: Any, current: Any) -> Any:
    # The equivalent current weights each phase by its unit trapezoid, below 1 outside the flats.
    sizes = np.abs(trapezoid(phase_angles(s.electrical)))
    return current * (0.5 * _mean(s, p, step, sizes.of_pairs()))


_BY_ANGLE = ConductingPair(_of_idle, _of_idle_throughout, _pair_current)
_BY_HALL_SENSORS = ConductingPair(_of_sensed_idle, _mean, _by_shape)
