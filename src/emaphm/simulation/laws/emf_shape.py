"""Shape of a back-EMF that deviates from the 120° trapezoid: narrower flats, a sine component."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.commutation import RAMP, from_zero

LINE_AMPLITUDE = 2 / 3**0.5
"""Amplitude of a phase's sine for an amplitude of 2 line to line, that of unit trapezoids [-]."""


def emf_shape(angle: Any, flat_loss: Any, sine_share: Any) -> Any:
    """Return the shape of a phase's back-EMF and of its torque per ampere.

        s(u) = (1 - ρ) sgn(u) min(min(|u|, π - |u|) / (π/6 + δ/2), 1) + ρ (2/√3) sin u

    Parameters
    ----------
    angle : u, electrical angle of the phase, in [-π, π) [rad]
    flat_loss : δ ≥ 0, 120 degrees less the width of the flats [rad]
    sine_share : ρ, share of the sine; negative if the flats sag in their middle [-]

    Returns
    -------
    s, shape [-]. For δ = ρ = 0 it is `commutation.trapezoid`. For flats of at least 60 degrees and
    0 ≤ ρ ≤ 1 its maximum line to line is 2, so that the torque constant is the amplitude line to line.

    Notes
    -----
    The sine is computed by a polynomial with an error below 6e-8: a function call would prevent a kernel from
    advancing several actuators per instruction.

    References
    ----------
    [1] D. C. Hanselman: Brushless permanent magnet motor design, 2nd ed., 2003, on the shape of the back-EMF.
    """
    distance = from_zero(angle)
    flat = np.minimum(distance / (RAMP + 0.5 * flat_loss), 1.0)
    shape = flat + sine_share * (LINE_AMPLITUDE * _sine(distance) - flat)
    return np.copysign(shape, angle)


def _sine(angle: Any) -> Any:
    """Return the sine of an angle in [0, π/2] [rad] by its power series up to the eleventh power."""
    square = angle * angle
    series = 1.0 - square * (1 / 110)
    for product in (72, 42, 20, 6):
        series = 1.0 - square * (1 / product) * series
    return angle * series
