"""Three-phase motor with sinusoidal back-EMF: its currents and voltages in the rotor's axes d and q.

The quantities in d and q are line values, so that the description of the motor is line to line, as for
trapezoidal back-EMF. θ_e is the angle of phase a's back-EMF, e_a ∝ sin θ_e; the magnets' flux (d) lags the
back-EMF (q) by a quarter of a turn. For phase quantities x_i with the amplitude X,

    x_q = g Σ x_i sin(θ_e - α_i),  x_d = -g Σ x_i cos(θ_e - α_i),  α_i = 2π (i - 1) / 3

with g = 1/√3 for currents: i_q = (√3/2) X, and g = 2/√3 for voltages: v_q = √3 X, the amplitude line to line.
Then v_d i_d + v_q i_q is the power, T = k_t i_q is the torque, and k_t = k_e is the amplitude of the back-EMF
line to line, per speed. With the resistance R_s and the inductance L_s, line to line,

    v_d = R_s i_d + L_s di_d/dt - P ω L_s i_q
    v_q = R_s i_q + L_s di_q/dt + P ω L_s i_d + k_e ω
"""

from typing import Any

from emaphm.simulation.laws.eccentricity import SQRT3_2
from emaphm.simulation.laws.phases import Phases

INVERSE_SQRT3 = 1 / 3**0.5
"""Amplitude of a phase's back-EMF per speed, for a line-to-line constant of 1."""


def phase_sines(cos: Any, sin: Any) -> Phases:
    """Return the unit shape of each phase's back-EMF: sin(θ_e - 2π (i - 1) / 3), i = 1, 2, 3.

    Parameters
    ----------
    cos, sin : cosine and sine of θ_e, the electrical angle [-]

    Returns
    -------
    s_i, in [-1, 1] [-].

    References
    ----------
    [1] S.-K. Sul: Control of electric machine drive systems, 2011, chapter 3.
    """
    return Phases(sin, -0.5 * sin - SQRT3_2 * cos, -0.5 * sin + SQRT3_2 * cos)


def line_currents(current: Phases, cos: Any, sin: Any) -> Any:
    """Return the currents in d and q, as line values, of three phase currents.

        i_d = -(1/√3) Σ i_i cos(θ_e - α_i),   i_q = (1/√3) Σ i_i sin(θ_e - α_i)

    Parameters
    ----------
    current : i_i, phase currents [A]
    cos, sin : cosine and sine of θ_e, the electrical angle; α_i = 2π (i - 1) / 3 [-]

    Returns
    -------
    i_d, i_q; the amplitude of the phase currents is 2/√3 √(i_d² + i_q²) [A].

    References
    ----------
    [1] R. H. Park: Two-reaction theory of synchronous machines. Trans. AIEE 48, 1929.
    """
    alpha = INVERSE_SQRT3 * (current.a - 0.5 * (current.b + current.c))
    beta = 0.5 * (current.b - current.c)
    return -(cos * alpha + sin * beta), sin * alpha - cos * beta


def line_voltages(voltage: Phases, cos: Any, sin: Any) -> Any:
    """Return the voltages in d and q, as line values, of three leg voltages; their mean has no effect.

        v_d = -(2/√3) Σ v_i cos(θ_e - α_i),   v_q = (2/√3) Σ v_i sin(θ_e - α_i)

    Parameters
    ----------
    voltage : v_i, leg voltages [V]
    cos, sin : cosine and sine of θ_e, the electrical angle; α_i = 2π (i - 1) / 3 [-]

    Returns
    -------
    v_d, v_q; the amplitude of the phase voltages is 1/√3 √(v_d² + v_q²) [V].
    """
    in_d, in_q = line_currents(voltage, cos, sin)
    return 2.0 * in_d, 2.0 * in_q


def phase_voltages(in_d: Any, in_q: Any, cos: Any, sin: Any) -> Phases:
    """Return the phase voltages for line values in d and q: the inverse of `line_voltages`.

        v_i = (v_q sin(θ_e - α_i) - v_d cos(θ_e - α_i)) / √3

    Parameters
    ----------
    in_d, in_q : v_d, v_q, line values [V]
    cos, sin : cosine and sine of θ_e, the electrical angle; α_i = 2π (i - 1) / 3 [-]

    Returns
    -------
    v_i, with the sum 0 [V].
    """
    alpha = INVERSE_SQRT3 * (in_q * sin - in_d * cos)
    beta = -0.5 * (in_q * cos + in_d * sin)
    return Phases(alpha, -0.5 * alpha + beta, -0.5 * alpha - beta)
