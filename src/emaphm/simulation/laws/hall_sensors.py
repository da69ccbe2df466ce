"""Commutation by Hall sensors that are out of place."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.commutation import RAMP
from emaphm.simulation.laws.phases import Phases
from emaphm.simulation.laws.select import clip, select

LEAST_TURN = 1e-9
"""Turn [rad] below which the rotor stands."""


def of_sensed_idle_phase(angle: Any, values: Phases, early: Phases) -> Any:
    """Return the one of three values that belongs to the phase that the Hall sensors let idle.

    The sensor of a phase switches where the phase's flat begins, and half a turn later, but for its error δ.
    With v = θ_e modulo π, in [0, π):

        a   (v < π/6 - δ_a or v ≥ 5π/6 - δ_b)
        c   (π/6 - δ_a ≤ v < π/2 - δ_c)
        b   (π/2 - δ_c ≤ v < 5π/6 - δ_b)

    Parameters
    ----------
    angle : θ_e, electrical angle, in [-π, π) [rad]
    values : what is returned while a phase idles, that is while the other two conduct
    early : δ, electrical angle by which the sensor of a phase switches too early, within ±30 degrees [rad]

    Returns
    -------
    One of the three values. With δ = 0 that of `commutation.of_idle_phase`.

    References
    ----------
    [1] P. Pillay, R. Krishnan: Modeling, simulation, and analysis of permanent-magnet motor drives, part II:
        the brushless DC motor drive. IEEE Trans. Ind. Appl. 25(2), 1989: commutation by three Hall sensors.
    """
    half_turn = select(angle < 0.0, angle + np.pi, angle)
    before = select(half_turn < RAMP - early.a, values.a, values.c)
    after = select(half_turn < 5 * RAMP - early.b, values.b, values.a)
    return select(half_turn < np.pi / 2 - early.c, before, after)


def sensed_demand_signs(angle: Any, angles: Any, early: Phases) -> Any:
    """Return what share of the reference current each phase is asked for, by its Hall sensors.

        r_i = sgn(u_i)   of the two phases that conduct
        r_i = 0          of the one that idles, by `of_sensed_idle_phase`

    Parameters
    ----------
    angle : θ_e, electrical angle, in [-π, π) [rad]
    angles : u, `Phases` of the electrical angle as each sees it, in [-π, π) [rad]
    early : δ, as of `of_sensed_idle_phase` [rad]

    Returns
    -------
    r, each one of -1, 0, +1 [-].
    """
    conducts = Phases(
        of_sensed_idle_phase(angle, Phases(0.0, 1.0, 1.0), early),
        of_sensed_idle_phase(angle, Phases(1.0, 0.0, 1.0), early),
        of_sensed_idle_phase(angle, Phases(1.0, 1.0, 0.0), early),
    )
    return conducts * np.copysign(1.0, angles)


def over_a_turn(angle: Any, turned: Any, values: Phases, early: Phases) -> Any:
    """Return the mean of `of_sensed_idle_phase` while the rotor turns on, over one step of a model.

    With l and h the lower and the upper end of the turn from v to v + Δ, what is beyond an edge e is

        S(e) = min(max((h - e) / (h - l), 0), 1)

    Parameters
    ----------
    angle : θ_e, electrical angle before the turn, in [-π, π) [rad]
    turned : Δ, by which it turns, either way; with δ less than 30 degrees [rad]
    values : as of `of_sensed_idle_phase`
    early : δ, as of `of_sensed_idle_phase` [rad]

    Returns
    -------
    The mean. It has no jumps over δ where the rotor turns, so that differences over δ are derivatives.
    """
    half_turn = select(angle < 0.0, angle + np.pi, angle)
    upper = half_turn + np.maximum(turned, 0.0)
    per_width = 1.0 / np.maximum(np.abs(turned), LEAST_TURN)
    beyond_a = clip((upper - (RAMP - early.a)) * per_width, 0.0, 1.0)
    beyond_c = clip((upper - (np.pi / 2 - early.c)) * per_width, 0.0, 1.0)
    beyond_b = clip((upper - (5 * RAMP - early.b)) * per_width, 0.0, 1.0)
    changes = beyond_a * (values.c - values.a) + beyond_c * (values.b - values.c)
    return values.a + (changes + beyond_b * (values.a - values.b))
