"""Commutation that is not by the rotor's true angle: Hall sensors out of place, their hysteresis, delays."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.angles import wrap_once
from emaphm.simulation.laws.commutation import RAMP, from_zero
from emaphm.simulation.laws.inverter import switch
from emaphm.simulation.laws.phases import Phases
from emaphm.simulation.laws.select import clip, select

LEAST_TURN = 1e-9
"""Turn [rad] below which the rotor stands."""

MOST_EARLY = 0.45
"""Error [rad] within which an edge is nearest to its own place, whatever a step turns."""


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
    """
    half_turn = select(angle < 0.0, angle + np.pi, angle)
    before = select(half_turn < RAMP - early.a, values.a, values.c)
    after = select(half_turn < 5 * RAMP - early.b, values.b, values.a)
    return select(half_turn < np.pi / 2 - early.c, before, after)


def seen_angle(electrical: Any, turning: Any, lag: Any, delay: Any) -> Any:
    """Return the electrical angle by which a drive commutates.

        θ_s = θ_e - T ω_e + max(-h, 0) sgn(ω_e)

    Parameters
    ----------
    electrical : θ_e, of the rotor, in [-π, π) [rad]
    turning : ω_e, electrical speed [rad/s]
    lag : h; above 0 it is that of `hall_signals` [rad]
    delay : T, by which commutation is late [s]

    Returns
    -------
    θ_s, in [-π, π) [rad].
    """
    return wrap_once(electrical - delay * turning + np.maximum(-lag, 0.0) * _direction(turning))


def hall_signals(before: Phases, angles: Any, early: Phases, lag: Any) -> Any:
    """Return what the Hall sensors show of the rotor's magnets, with hysteresis.

    The field at the sensor of a phase changes its sign where the phase's flat begins, and half a turn later,
    but for the sensor's error δ. With e = u - π/6 + δ, and |e| ≤ π/2 from the nearest change,

        s⁺ = +1   (e > h)
        s⁺ = -1   (e < -h)
        s⁺ = s    elsewhere

    Parameters
    ----------
    before : s, what they have shown before, `Phases` of +1 and -1 [-]
    angles : u, `Phases` of the electrical angle as each sees it, in [-π, π) [rad]
    early : δ, as of `of_sensed_idle_phase` [rad]
    lag : h, hysteresis either way; none below 0 [rad]

    Returns
    -------
    s⁺, `Phases` of +1 and -1 [-].

    References
    ----------
    [1] P. Pillay, R. Krishnan: Modeling, simulation, and analysis of permanent-magnet motor drives, part II:
        the brushless DC motor drive. IEEE Trans. Ind. Appl. 25(2), 1989: commutation by three Hall sensors.
    """
    own = wrap_once(angles - RAMP + early)
    return switch(before, np.copysign(from_zero(own), own), np.maximum(lag, 0.0))


def signalled_demand(signals: Phases) -> Phases:
    """Return what share of the reference current each phase is asked for by three Hall sensors.

        r_i = (s_i - s_j) / 2,   j the phase that lags i

    Parameters
    ----------
    signals : s, `Phases` of +1 and -1 [-]

    Returns
    -------
    r, each one of -1, 0, +1 [-].
    """
    a, b, c = signals
    return Phases(0.5 * (a - b), 0.5 * (b - c), 0.5 * (c - a))


def early_by_turning(early: Phases, turning: Any, lag: Any, delay: Any) -> Any:
    """Return by how much the edges of each sensor are early while the rotor turns in one direction.

        δ_i - h sgn(ω_e) - T ω_e, within ±0.45 rad

    It is what `seen_angle` and `hall_signals` make of them, but where the direction changes between an edge
    and its hysteresis. Parameters are those of these functions.
    """
    return clip(early - (lag * _direction(turning) + delay * turning), -MOST_EARLY, MOST_EARLY)


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


def _direction(turning: Any) -> Any:
    return select(turning == 0.0, 0.0, np.copysign(1.0, turning))
