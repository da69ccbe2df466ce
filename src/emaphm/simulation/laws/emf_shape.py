"""A back-EMF that is no trapezoid with flats of 120 degrees: narrower flats, or something of a sine."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.commutation import RAMP

LINE_AMPLITUDE = 2 / 3**0.5
"""Amplitude of the sines in the phases whose amplitude line to line is that of unit trapezoids, 2."""


def emf_shape(angle: Any, sine: Any, flat_loss: Any, sine_share: Any) -> Any:
    """Return the shape of a phase's back-EMF, and of its torque per ampere.

        (1 - ρ) sgn(u) min(min(|u|, π - |u|) / (π/6 + δ/2), 1) + ρ (2/√3) sin u

    Parameters
    ----------
    angle : u, electrical angle as the phase sees it, in [-π, π) [rad]
    sine : sin u [-]
    flat_loss : δ, by how much the flats are narrower than 120 degrees, at least 0 [rad]
    sine_share : ρ, of the sine; below 0 where the flats have a hollow [-]

    Returns
    -------
    The shape [-], with δ = ρ = 0 that of `commutation.trapezoid`. Its largest value line to line is 2 for
    flats of 60 degrees at least and a share from 0 to 1: the torque constant is the amplitude line to line.

    References
    ----------
    [1] D. C. Hanselman: Brushless permanent magnet motor design, 2nd ed., 2003, on the shape of the back-EMF.
    """
    magnitude = np.abs(angle)
    from_zero = np.minimum(magnitude, np.pi - magnitude)
    flat = np.copysign(np.minimum(from_zero / (RAMP + 0.5 * flat_loss), 1.0), angle)
    return flat + sine_share * (LINE_AMPLITUDE * sine - flat)
