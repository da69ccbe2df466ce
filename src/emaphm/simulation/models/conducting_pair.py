"""Which two phases conduct, and what the recorded equivalent current shows of their current."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from emaphm.simulation.engine.structure import Structure
from emaphm.simulation.laws.angles import phase_angles
from emaphm.simulation.laws.commutation import of_idle_phase, trapezoid
from emaphm.simulation.laws.phases import Phases
from emaphm.simulation.laws.sensed_commutation import early_by_turning, of_sensed_idle_phase, over_a_turn

NUMBERS = Phases(0.0, 1.0, 2.0)
"""By which a state names the phase that idles."""


class ConductingPair(NamedTuple):
    """The pair by the angle of the rotor, or by Hall sensors that are out of place."""

    of_idle: Callable[..., Any]
    """Of (state, parameters, three values): the one of the phase that idles as a step begins."""
    mean: Callable[..., Any]
    """Of (state, parameters, step [s], three values): the mean over the step of that of the idle phase."""
    shown: Callable[..., Any]
    """Of (state, parameters, step [s], the pair's current): the equivalent current."""


def conducting_pair(structure: Structure) -> ConductingPair:
    """Return the pair of an actuator."""
    return _BY_HALL_SENSORS if structure.commutation else _BY_ANGLE


def _of_idle(s: Any, p: Any, values: Phases) -> Any:  # noqa: ARG001
    return of_idle_phase(s.electrical, values)


def _of_idle_throughout(s: Any, p: Any, step: Any, values: Phases) -> Any:  # noqa: ARG001
    return of_idle_phase(s.electrical, values)


def _whole(s: Any, p: Any, step: Any, current: Any) -> Any:  # noqa: ARG001
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
    # A phase that conducts outside the flat of its unit trapezoid counts less.
    sizes = np.abs(trapezoid(phase_angles(s.electrical)))
    return current * (0.5 * _mean(s, p, step, sizes.of_pairs()))


_BY_ANGLE = ConductingPair(_of_idle, _of_idle_throughout, _whole)
_BY_HALL_SENSORS = ConductingPair(_of_sensed_idle, _mean, _by_shape)
