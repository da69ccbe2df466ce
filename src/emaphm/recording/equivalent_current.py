"""Equivalent current: the single current that produces the torque of the three phase currents together."""

from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from emaphm.actuator import Actuator
from emaphm.actuator.parameters import Electrical
from emaphm.arrays import Array
from emaphm.errors import RecordingError, nearest
from emaphm.recording.recording import Recording
from emaphm.recording.schema import PHASES, RESPONSES

Form = Literal["torque", "active", "magnitude"]

COARSE_RAD = np.radians(4.0)
"""Step of the electrical angle [rad] above which a note is given. For four random fault vectors, the error of
a current of 5 A was 0.01 A with steps of 4 degrees, 0.03 A with 9, and 0.05 to 0.12 A with 18."""

NOT_COMPARED = "the phase currents are not compared"
"""Beginning of the note on phase currents from which no equivalent current can be computed."""

MADE_OF = (*PHASES, "angle_rad")
"""Channels from which the equivalent current is computed."""


def equivalent_current(
    phases: ArrayLike, angle: ArrayLike, pole_pairs: int, form: Form = "torque"
) -> NDArray[np.float64]:
    """Return the equivalent current of three phase currents.

    With s_i the unit trapezoid and r_i the commutation of phase i at its electrical angle
    P angle - 2 pi (i - 1)/3:

    - ``torque``: 1/2 sum s_i i_i
    - ``active``: 1/2 sum r_i i_i
    - ``magnitude``: 1/2 sum |i_i| × sign(sum s_i i_i), for comparison with the thesis: the ripple of the idle
      phase biases it (`docs/physics.md`, section 6).

    Parameters
    ----------
    phases
        Currents of phases a, b, c [A], shape (3, n).
    angle
        Motor angle [rad], shape (n,), unwrapped or not.
    pole_pairs
        P, number of pole pairs.
    form
        Definition to use, see above.

    Returns
    -------
    Current [A], shape (n,).

    Raises
    ------
    RecordingError
        Shapes do not fit each other, or `form` is unknown.

    References
    ----------
    Thesis sections 3.1.3 and 6.2.
    """
    # Imported here, because they load the whole simulation, which a file with `current_A` does not need.
    from emaphm.simulation.laws.angles import PHASE_SHIFT, wrap
    from emaphm.simulation.laws.commutation import demand_sign, trapezoid

    currents, motor_angle = _phases_and_angle(phases, angle)
    electrical = np.stack([wrap(pole_pairs * motor_angle - PHASE_SHIFT * phase) for phase in range(3)])
    torque = 0.5 * np.sum(trapezoid(electrical) * currents, axis=0)
    if form == "torque":
        return np.asarray(torque, float)
    if form == "active":
        return np.asarray(0.5 * np.sum(demand_sign(electrical) * currents, axis=0), float)
    if form == "magnitude":
        return np.asarray(0.5 * np.sum(np.abs(currents), axis=0) * np.sign(torque), float)
    raise RecordingError(f"unknown equivalent current '{form}'{nearest(form, get_args(Form))}")


def sinusoidal_equivalent_current(
    phases: ArrayLike, angle: ArrayLike, pole_pairs: int
) -> NDArray[np.float64]:
    """Return the equivalent current of a motor with sinusoidal back-EMF: its q-axis current, as a line value.

        i = 1/√3 Σ sin(P θ - 2π (i - 1)/3) i_i

    The torque is torque_constant × i, with torque_constant the amplitude of the line-to-line back-EMF per
    speed. Sinusoidal currents in phase with the back-EMF have the amplitude 2/√3 i.

    Parameters
    ----------
    phases
        Currents of phases a, b, c [A], shape (3, n).
    angle
        θ, motor angle [rad], shape (n,), unwrapped or not.
    pole_pairs
        P, number of pole pairs.

    Returns
    -------
    Current [A], shape (n,).

    Raises
    ------
    RecordingError
        Shapes do not fit each other.
    """
    from emaphm.simulation.laws.phases import Phases
    from emaphm.simulation.laws.sine_motor import line_currents

    currents, motor_angle = _phases_and_angle(phases, angle)
    electrical = pole_pairs * motor_angle
    current = line_currents(Phases(*currents), np.cos(electrical), np.sin(electrical))[1]
    return np.asarray(current, float)


def _phases_and_angle(phases: ArrayLike, angle: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    currents, motor_angle = np.asarray(phases, float), np.asarray(angle, float)
    if currents.shape != (3, *motor_angle.shape):
        raise RecordingError(
            f"phase currents of shape {currents.shape} do not fit an angle of shape {motor_angle.shape}; "
            "give three rows, each as long as the angle"
        )
    return currents, motor_angle


def rotor_angle(recording: Recording, electrical: Electrical) -> Array:
    """Return the recorded `angle_rad` (n,) [rad], from the angle where the electrical angle is 0."""
    return recording["angle_rad"] + electrical.rotor_zero / electrical.pole_pairs


def with_equivalent_current(recording: Recording, actuator: Actuator) -> Recording:
    """Return `recording` with `current_A`, computed from its phase currents and `angle_rad` if it is absent.

    The back-EMF is taken as sinusoidal if the drive is "foc", else as trapezoidal. If the current cannot be
    computed, but other channels can be compared with a model, a note gives the reason.

    Raises
    ------
    RecordingError
        Only the phase currents could be compared, and the actuator has no electrical description with the
        pole pairs.
    """
    phases_recorded = [name for name in PHASES if name in recording]
    if "current_A" in recording or not phases_recorded:
        return recording
    missing = [name for name in MADE_OF if name not in recording]
    has_responses = any(name in recording for name in RESPONSES)
    if missing:
        reason = f"no {', '.join(missing)}"
        return recording.with_channels(
            recording.channels, [f"{NOT_COMPARED}: {reason} to make current_A of them"]
        )
    if actuator.electrical is None and has_responses:
        reason = "the actuator's description has no pole pairs"
        return recording.with_channels(recording.channels, [f"{NOT_COMPARED}: {reason}"])
    if actuator.electrical is None:
        raise RecordingError(
            f"{recording.source}: no column 'current_A', and to make it from the phases the pole pairs are "
            "needed; add that column, or [electrical] to the actuator's TOML"
        )
    phases = np.stack([recording[name] for name in PHASES])
    current_of = sinusoidal_equivalent_current if actuator.drive_kind == "foc" else equivalent_current
    current = current_of(phases, rotor_angle(recording, actuator.electrical), actuator.electrical.pole_pairs)
    notes = _notes_on_angle(recording["angle_rad"], actuator.electrical.pole_pairs)
    return recording.with_channels({**recording.channels, "current_A": current}, notes)


def without_equivalent_current(recording: Recording, actuator: Actuator) -> Recording:
    """Return `recording` without a `current_A` that equals the equivalent current of its phases to rounding.

    Such a current was computed, not measured: it has the errors of the phase sensors and can be computed
    again. A separate current sensor would have its own noise.
    """
    if actuator.electrical is None or not all(name in recording for name in (*MADE_OF, "current_A")):
        return recording
    measured = {name: values for name, values in recording.channels.items() if name != "current_A"}
    without = recording.with_channels(measured)
    computed = with_equivalent_current(without, actuator)["current_A"]
    rounding = 1e-9 * float(np.max(np.abs(computed)))
    return without if np.allclose(recording["current_A"], computed, rtol=0.0, atol=rounding) else recording


def _notes_on_angle(angle: Array, pole_pairs: int) -> list[str]:
    """Return a note if the steps of the recorded angle (n,) are too coarse to weight the phases."""
    values = np.unique(angle)
    electrical = pole_pairs * float(np.diff(values).min(initial=np.inf))
    # If hardly any value repeats, the steps are the motion from row to row, not the sensor's resolution.
    if values.size > angle.size / 2 or not COARSE_RAD < electrical < np.inf:
        return []
    steps_deg, least_deg = np.degrees(electrical), np.degrees(COARSE_RAD)
    note = (
        f"angle_rad has steps of {steps_deg:.2g} degrees electrical: current_A, made of the phases by it, "
        f"is off where one phase takes over from another; record steps of {least_deg:.0f} degrees or less, "
        "or current_A"
    )
    return [note]
