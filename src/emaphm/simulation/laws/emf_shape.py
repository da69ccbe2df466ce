"""A back-EMF that is no trapezoid with flats of 120 degrees: narrower flats, or something of a sine."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.commutation import RAMP, from_zero

LINE_AMPLITUDE = 2 / 3**0.5
"""Amplitude of the sines in the phases whose amplitude line to line is that of unit trapezoids, 2."""


def emf_shape(angle: Any, flat_loss: Any, sine_share: Any) -> Any:
    """Return the shape of a phase's back-EMF, and of its torque per ampere.

        (1 - ρ) sgn(u) min(min(|u|, π - |u|) / (π/6 + δ/2), 1) + ρ (2/√3) sin u

    Parameters
    ----------
    angle : u, electrical angle as the phase sees it, in [-π, π) [rad]
    flat_loss : δ, by how much the flats are narrower than 120 degrees, at least 0 [rad]
    sine_share : ρ, of the sine; below 0 where the flats have a hollow [-]

    Returns
    -------
    The shape [-], with δ = ρ = 0 that of `commutation.trapezoid`. Its largest value line to line is 2 for
    flats of 60 degrees at least and a share from 0 to 1: the torque constant is the amplitude line to line.

    Notes
    -----
    The sine is a polynomial, within 6e-8, as a call would keep a kernel from advancing several actuators at
    once.

    References
    ----------
    [1] D. C. Hanselman: Brushless permanent magnet motor design, 2nd ed., 2003, on the shape of the back-EMF.
    """
    away = from_zero(angle)
    flat = np.minimum(away / (RAMP + 0.5 * flat_loss), 1.0)
    shape = flat + sine_share * (LINE_AMPLITUDE * _sine(away) - flat)
    return np.copysign(shape, angle)


def _sine(angle: Any) -> Any:
    """Return the sine of an angle in [0, π/2], by its series up to the eleventh power."""
    square = angle * angle
    series = 1.0 - square * (1 / 110)
    for product in (72, 42, 20, 6):
        series = 1.0 - square * (1 / product) * series
    return angle * series
