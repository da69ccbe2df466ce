"""Sensors of three phase currents against each other: one with another scale, or in another's place."""

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
    """When phases disagree.

    The sum of the currents of a star is 0. An error of one sensor's scale makes it a multiple of that phase:
    it is named from `least_scale` and `certain` standard errors on, if its residual is no more than
    `residual` times the noise and counts of the sum, and another phase's `rival` times as much. Phases are in
    another order if that order gives `right` of the current's magnitude as torque at least, and `better`
    times as much as the recorded one, while the rotor makes a turn.
    """

    least_scale: float = 0.01
    certain: float = 8.0
    residual: float = 1.5
    rival: float = 1.02
    right: float = 0.85
    better: float = 1.15


PHASE = PhaseSettings()


def phase_findings(recording: Recording, actuator: Actuator) -> tuple[dict[str, Array], list[SensorFinding]]:
    """Return the corrected phases, (samples,) each by channel, and what was wrong with them."""
    if "current_A" in recording or not all(name in recording for name in PHASES):
        return {}, []
    phases = {name: recording[name] for name in PHASES}
    scaled, findings = _balanced(phases)
    ordered, more = _ordered({**phases, **scaled}, recording, actuator)
    return {**scaled, **ordered}, [*findings, *more]


def _balanced(phases: Mapping[str, Array]) -> tuple[dict[str, Array], list[SensorFinding]]:
    """Return the phase that keeps the sum from 0, made of the other two, and its finding."""
    total = np.sum(list(phases.values()), axis=0)
    noise = (row_noise(total) ** 2 + sum(step_of_counts(one) ** 2 / 12 for one in phases.values())) ** 0.5
    (residual, error, scale, name), (second, *_), _ = sorted(
        _scale_of(name, phases, total) for name in phases
    )
    certain = abs(scale) > max(PHASE.least_scale, PHASE.certain * error)
    if not certain or residual > PHASE.residual * noise or second < PHASE.rival * residual:
        return {}, []
    others = [one for one in phases if one != name]
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
    """Return the sum's residual without an error of one phase's scale, its standard error, it, the phase."""
    others = -sum(values for other, values in phases.items() if other != name)
    assert isinstance(others, np.ndarray)  # noqa: S101 - a sum of arrays
    true = others - others.mean()
    power = max(float(true @ true), np.finfo(float).tiny)
    scale = float(true @ (total - total.mean())) / power
    residual = float(np.std(total - scale * others))
    return residual, residual / power**0.5, scale, name


def _ordered(
    phases: Mapping[str, Array], recording: Recording, actuator: Actuator
) -> tuple[dict[str, Array], list[SensorFinding]]:
    """Return the phases in the order that makes torque of their currents, where the recorded one does not."""
    if "angle_rad" not in recording or actuator.electrical is None:
        return {}, []
    angle, pairs = rotor_angle(recording, actuator.electrical), actuator.electrical.pole_pairs
    if np.ptp(np.unwrap(angle)) * pairs < 2 * np.pi:
        return {}, []
    of_motor = sinusoidal_equivalent_current if actuator.drive_kind == "foc" else equivalent_current
    magnitude = rms(np.stack(list(phases.values())))
    shares = {
        order: rms(of_motor(np.stack([phases[name] for name in order]), angle, pairs))
        for order in permutations(PHASES)
    }
    best = max(shares, key=lambda order: shares[order])
    # A current that makes all the torque it can: rms of the phases × √(3/2), in either shape of the field.
    right = PHASE.right * 1.5**0.5 * magnitude
    if best == PHASES or shares[best] < max(right, PHASE.better * shares[PHASES]):
        return {}, []
    moved = [name for name, true in zip(PHASES, best, strict=True) if name != true]
    sentence = (
        f"{' and '.join(moved)} are in each other's place, by the torque that they make at the recorded "
        f"angle; they were taken as {', '.join(best)}. Check the wiring, or the names under [channels]"
    )
    finding = SensorFinding(" and ".join(moved), "swapped", float(len(moved)), "channels", sentence)
    return {name: phases[true] for name, true in zip(PHASES, best, strict=True)}, [finding]
