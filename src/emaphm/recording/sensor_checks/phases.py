"""Comparison of the three phase-current sensors: wrong scale, reversed sign, swapped channels."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array, rms
from emaphm.recording.equivalent_current import (
    equivalent_current,
    rotor_angle,
    sinusoidal_equivalent_current,
)
from emaphm.recording.recording import Recording
from emaphm.recording.schema import PHASES
from emaphm.recording.sensor_checks.finding import SensorFinding
from emaphm.recording.sensor_checks.resolution import row_noise, step_of_counts


@dataclass(frozen=True)
class PhaseSettings:
    """Thresholds from which phase currents are inconsistent.

    The sum of the currents of a star connection is 0. With a scale error of one sensor it is a multiple of
    that phase's current. The error is reported if it exceeds `least_scale` and `certain` standard errors, if
    the residual is at most `residual` times the noise and rounding of the sum, and if the residual for any
    other phase is at least `rival` times as large. Phases are swapped if another order gives a torque of at
    least `right` of the torque that currents of this magnitude can produce, and `better` times the torque of
    the recorded order, while the rotor makes at least one electrical turn.
    """

    least_scale: float = 0.01
    certain: float = 8.0
    residual: float = 1.5
    rival: float = 1.02
    right: float = 0.85
    better: float = 1.15


PHASE = PhaseSettings()


def phase_findings(recording: Recording, actuator: Actuator) -> tuple[dict[str, Array], list[SensorFinding]]:
    """Return the corrected phase currents, (samples,) each by channel, and the findings on them."""
    if "current_A" in recording or not all(name in recording for name in PHASES):
        return {}, []
    phases = {name: recording[name] for name in PHASES}
    scaled, scale_findings = _with_scale_corrected(phases)
    ordered, order_findings = _with_order_corrected({**phases, **scaled}, recording, actuator)
    return {**scaled, **ordered}, [*scale_findings, *order_findings]


def _with_scale_corrected(phases: Mapping[str, Array]) -> tuple[dict[str, Array], list[SensorFinding]]:
    """Return the phase current with a scale error, recomputed from the other two, and its finding."""
    total = np.sum(list(phases.values()), axis=0)
    noise = (
        row_noise(total) ** 2 + sum(step_of_counts(values) ** 2 / 12 for values in phases.values())
    ) ** 0.5
    (residual, error, scale, name), (second, *_), _ = sorted(
        _scale_of(name, phases, total) for name in phases
    )
    certain = abs(scale) > max(PHASE.least_scale, PHASE.certain * error)
    if not certain or residual > PHASE.residual * noise or second < PHASE.rival * residual:
        return {}, []
    others = [phase for phase in phases if phase != name]
    corrected = -(phases[others[0]] + phases[others[1]])
    reversed_ = abs(scale + 2) < 0.2
    kind = "reversed" if reversed_ else "scale"
    how = "is reversed" if reversed_ else f"shows {1 + scale:.3g} times the current"
    sentence = (
        f"{name} {how}, by the sum of the three phases, which is 0 in a star; it was made of the other two. "
        "Check that sensor, or its sign and scale under [channels]"
    )
    return {name: corrected}, [SensorFinding(name, kind, scale, "-", sentence)]


def _scale_of(name: str, phases: Mapping[str, Array], total: Array) -> tuple[float, float, float, str]:
    """Return residual, standard error and size of a scale error of phase `name`, from the sum, and `name`.

    The residual [A] is the standard deviation of the sum without that scale error.
    """
    implied = -sum(values for phase, values in phases.items() if phase != name)
    assert isinstance(implied, np.ndarray)  # noqa: S101 - a sum of arrays
    deviation = implied - implied.mean()
    power = max(float(deviation @ deviation), np.finfo(float).tiny)
    scale = float(deviation @ (total - total.mean())) / power
    residual = float(np.std(total - scale * implied))
    return residual, residual / power**0.5, scale, name


def _with_order_corrected(
    phases: Mapping[str, Array], recording: Recording, actuator: Actuator
) -> tuple[dict[str, Array], list[SensorFinding]]:
    """Return the phase currents in the order that produces torque, and the finding, if they are swapped."""
    if "angle_rad" not in recording or actuator.electrical is None:
        return {}, []
    angle, pairs = rotor_angle(recording, actuator.electrical), actuator.electrical.pole_pairs
    if np.ptp(np.unwrap(angle)) * pairs < 2 * np.pi:
        return {}, []
    current_of = sinusoidal_equivalent_current if actuator.drive_kind == "foc" else equivalent_current
    magnitude = rms(np.stack(list(phases.values())))
    shares = {
        order: rms(current_of(np.stack([phases[name] for name in order]), angle, pairs))
        for order in permutations(PHASES)
    }
    best = max(shares, key=lambda order: shares[order])
    # Equivalent current at the largest torque: rms of the phases × √(3/2), for either shape of the back-EMF.
    least = PHASE.right * 1.5**0.5 * magnitude
    if best == PHASES or shares[best] < max(least, PHASE.better * shares[PHASES]):
        return {}, []
    swapped = [name for name, phase in zip(PHASES, best, strict=True) if name != phase]
    sentence = (
        f"{' and '.join(swapped)} are in each other's place, by the torque that they make at the recorded "
        f"angle; they were taken as {', '.join(best)}. Check the wiring, or the names under [channels]"
    )
    finding = SensorFinding(" and ".join(swapped), "swapped", float(len(swapped)), "channels", sentence)
    return {name: phases[phase] for name, phase in zip(PHASES, best, strict=True)}, [finding]
