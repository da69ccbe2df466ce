"""What channels that were not recorded would add to the information on an estimate."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from emaphm.actuator.quantity import unit_for
from emaphm.arrays import Array, rms
from emaphm.estimation.objective import CORRELATED_ROWS
from emaphm.estimation.uncertainty.fisher_information import information_lower_bound
from emaphm.recording.schema import SCHEMA

UNRECORDED_NOISE = 0.03
"""Assumed noise of an unrecorded channel, relative to the largest rms of the channels in its unit: the sensor
of a current that is held at 0 is as good as that of the one which makes the torque, and no better."""


def further_channels_information(
    signals: Mapping[str, Array],
    jacobians: Mapping[str, Array],
    recorded: Collection[str],
    deviation: float = 0.0,
) -> dict[str, Array]:
    """Return the information (d, d) that each channel would add which is not among those `recorded`.

    Of its derivatives only that part counts which is no sum of those of recorded channels, each times a
    constant: a channel that is one of them under another name adds nothing.

    Parameters
    ----------
    signals
        Of all channels, (rows,) each.
    jacobians
        Their derivatives by the coordinates, (n, d, rows) each: n replicates.
    deviation
        Change of the coordinates whose effect is the least size of a signal: of one that hardly varies.
    """
    known = [jacobians[name] for name in recorded]
    information = {}
    for name, derivatives in jacobians.items():
        if name in recorded:
            continue
        alike = [one for other, one in signals.items() if _unit(other) == _unit(name)]
        size = max(*map(rms, alike), deviation * rms(derivatives))
        information[name] = signal_information(_own_part(derivatives, known), size)
    return information


def _unit(name: str) -> str:
    return unit_for(SCHEMA[name].unit, "rotary")


def signal_information(jacobians: Array, size: float) -> Array:
    """Return the information (d, d) of a signal, by its `jacobians` (n, d, rows); none of rms `size` 0."""
    if size == 0:
        return np.zeros((jacobians.shape[1],) * 2)
    return information_lower_bound(jacobians) / ((UNRECORDED_NOISE * size) ** 2 * CORRELATED_ROWS)


def _own_part(derivatives: Array, known: Sequence[Array]) -> Array:
    """Return `derivatives` (n, d, rows) less the sum of the `known` ones that is nearest to them.

    Coordinates count alike, by what they make of the channel; of one that makes nothing of it, nothing is
    subtracted.
    """
    target = derivatives.mean(axis=0)
    sizes = np.sqrt(np.mean(target**2, axis=1))
    acting = sizes > 0
    if not acting.any() or not known:
        return derivatives
    scale = sizes[acting, np.newaxis]
    design = np.stack([(one.mean(axis=0)[acting] / scale).ravel() for one in known], axis=1)
    shares = np.linalg.lstsq(design, (target[acting] / scale).ravel())[0]
    own = derivatives.copy()
    own[:, acting] -= np.tensordot(shares, np.stack(known)[:, :, acting], axes=1)
    return own
