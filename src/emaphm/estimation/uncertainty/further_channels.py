"""Information on an estimate that unrecorded channels would add."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from emaphm.actuator.quantity import unit_for
from emaphm.arrays import Array, rms
from emaphm.estimation.objective import CORRELATED_ROWS
from emaphm.estimation.uncertainty.fisher_information import information_lower_bound
from emaphm.recording.schema import SCHEMA

UNRECORDED_NOISE = 0.03
"""Assumed noise of an unrecorded channel, relative to the largest rms of the channels in its unit: the sensor
of a current that is controlled to 0 has the same noise as the sensor of the torque-producing current."""


def further_channels_information(
    signals: Mapping[str, Array],
    jacobians: Mapping[str, Array],
    recorded: Collection[str],
    deviation: float = 0.0,
) -> dict[str, Array]:
    """Return the information (d, d) that each channel not in `recorded` would add, by channel.

    Only the part of its derivatives counts that is not a linear combination of the derivatives of recorded
    channels: a channel that repeats a recorded one under another name adds no information.

    Parameters
    ----------
    signals
        Signals of all channels, (rows,) each.
    jacobians
        Their derivatives by the coordinates, (n, d, rows) each: n replicates.
    deviation
        Change of the coordinates whose effect is the least size of a signal, for signals that hardly vary.
    """
    of_recorded = [jacobians[name] for name in recorded]
    information = {}
    for name, derivatives in jacobians.items():
        if name in recorded:
            continue
        same_unit = [signal for channel, signal in signals.items() if _unit(channel) == _unit(name)]
        size = max(*map(rms, same_unit), deviation * rms(derivatives))
        information[name] = signal_information(_own_part(derivatives, of_recorded), size)
    return information


def _unit(name: str) -> str:
    """Return the unit of channel `name` of a rotary actuator."""
    return unit_for(SCHEMA[name].unit, "rotary")


def signal_information(jacobians: Array, size: float) -> Array:
    """Return the information (d, d) of a signal of rms `size` from `jacobians` (n, d, rows); 0 at size 0."""
    if size == 0:
        return np.zeros((jacobians.shape[1],) * 2)
    return information_lower_bound(jacobians) / ((UNRECORDED_NOISE * size) ** 2 * CORRELATED_ROWS)


def _own_part(derivatives: Array, of_recorded: Sequence[Array]) -> Array:
    """Return `derivatives` (n, d, rows) minus their least-squares fit by those of recorded channels.

    All coordinates have the same weight, as their derivatives are scaled by their rms; coordinates without an
    effect on the channel are unchanged.
    """
    target = derivatives.mean(axis=0)
    sizes = np.sqrt(np.mean(target**2, axis=1))
    acting = sizes > 0
    if not acting.any() or not of_recorded:
        return derivatives
    scale = sizes[acting, np.newaxis]
    design = np.stack([(recorded.mean(axis=0)[acting] / scale).ravel() for recorded in of_recorded], axis=1)
    shares = np.linalg.lstsq(design, (target[acting] / scale).ravel())[0]
    remainder = derivatives.copy()
    remainder[:, acting] -= np.tensordot(shares, np.stack(of_recorded)[:, :, acting], axes=1)
    return remainder
