"""Commutation by Hall sensors with position errors, hysteresis and delay."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.angles import wrap_once
from emaphm.simulation.laws.commutation import RAMP, from_zero
from emaphm.simulation.laws.inverter import switch
from emaphm.simulation.laws.phases import Phases
from emaphm.simulation.laws.select import clip, select

LEAST_TURN = 1e-9
"""Rotation in a step below which the rotor counts as at rest [rad]."""

MOST_EARLY = 0.45
"""Largest error of an edge [rad]: within it, the order of the edges is kept for any rotation in a step."""


def of_sensed_idle_phase(angle: Any, values: Phases, early: Phases) -> Any:
    """Return the value that belongs to the idle phase according to the Hall sensors.

    Without error, the sensor of a phase switches at the start of the phase's flat and half a turn later; the
    error δ moves both edges. With v = θ_e modulo π, in [0, π), the idle phase is

        a   (v < π/6 - δ_a or v ≥ 5π/6 - δ_b)
        c   (π/6 - δ_a ≤ v < π/2 - δ_c)
        b   (π/2 - δ_c ≤ v < 5π/6 - δ_b)

    Parameters
    ----------
    angle : θ_e, electrical angle, in [-π, π) [rad]
    values : for each phase, the value to return while it idles, that is, while the two other phases conduct
    early : δ, electrical angle by which the sensor of a phase switches too early, within ±30 degrees [rad]

    Returns
    -------
    The value of the idle phase. For δ = 0 the law is `commutation.of_idle_phase`.
    """
    half_turn = select(angle < 0.0, angle + np.pi, angle)
    before = select(half_turn < RAMP - early.a, values.a, values.c)
    after = select(half_turn < 5 * RAMP - early.b, values.b, values.a)
    return select(half_turn < np.pi / 2 - early.c, before, after)


def seen_angle(electrical: Any, turning: Any, lag: Any, delay: Any) -> Any:
    """Return the electrical angle at which a drive commutates.

        θ_s = θ_e - T ω_e + max(-h, 0) sgn(ω_e)

    Parameters
    ----------
    electrical : θ_e, electrical angle of the rotor, in [-π, π) [rad]
    turning : ω_e, electrical speed [rad/s]
    lag : h; h > 0 is a hysteresis and acts in `hall_signals`, h < 0 advances the commutation [rad]
    delay : T, delay of the commutation [s]

    Returns
    -------
    θ_s, in [-π, π) [rad].
    """
    return wrap_once(electrical - delay * turning + np.maximum(-lag, 0.0) * _direction(turning))


def hall_signals(before: Phases, angles: Any, early: Phases, lag: Any) -> Any:
    """Return the signals of the Hall sensors, with hysteresis.

    Without error, the field at the sensor of a phase changes its sign at the start of the phase's flat and
    half a turn later; the error δ of the sensor moves both edges. With w = u - π/6 + δ wrapped into [-π, π),
    and e = sgn(w) min(|w|, π - |w|), the signed distance from the nearest edge:

        s⁺ = +1   (e > h)
        s⁺ = -1   (e < -h)
        s⁺ = s    (otherwise)

    Parameters
    ----------
    before : s, signals before the step, `Phases` of +1 and -1 [-]
    angles : u, `Phases` of the electrical angle of each phase, in [-π, π) [rad]
    early : δ, as in `of_sensed_idle_phase` [rad]
    lag : h, half width of the hysteresis; negative values act as 0 [rad]

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
    """Return the reference current of each phase according to three Hall sensors, relative to the drive's.

        r_i = (s_i - s_j) / 2,   j the phase that lags i: r_a = (s_a - s_b) / 2 and so on

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
    """Return the angle by which the edges of each sensor are early while the rotor turns in one direction.

        clip(δ_i - h sgn(ω_e) - T ω_e, -0.45 rad, 0.45 rad)

    This is the combined effect of `seen_angle` and `hall_signals`, except where the direction changes within
    the hysteresis of an edge.

    Parameters
    ----------
    early, turning, lag, delay : δ_i [rad], ω_e [rad/s], h [rad], T [s], as in these two functions

    Returns
    -------
    Advance of the edges, `Phases` [rad].
    """
    return clip(early - (lag * _direction(turning) + delay * turning), -MOST_EARLY, MOST_EARLY)


def over_a_turn(angle: Any, turned: Any, values: Phases, early: Phases) -> Any:
    """Return the mean of `of_sensed_idle_phase` over one step of a model, in which the rotor turns.

    With v = θ_e modulo π, and l and h the lower and the upper of v and v + Δ, the share of the step beyond an
    edge e is S(e). With the values A, B, C of the phases a, b, c and the edges e_a = π/6 - δ_a,
    e_c = π/2 - δ_c, e_b = 5π/6 - δ_b:

        S(e) = min(max((h - e) / (h - l), 0), 1)
        mean = A + S(e_a) (C - A) + S(e_c) (B - C) + S(e_b) (A - B)

    Parameters
    ----------
    angle : θ_e, electrical angle before the step, in [-π, π) [rad]
    turned : Δ, change of the electrical angle in the step; |Δ| and |δ| together below 30 degrees [rad]
    values : A, B, C, as in `of_sensed_idle_phase`
    early : δ, as in `of_sensed_idle_phase` [rad]

    Returns
    -------
    The mean, in the unit of the values. While the rotor turns it is a continuous function of δ, so that
    finite differences over δ are derivatives.
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
