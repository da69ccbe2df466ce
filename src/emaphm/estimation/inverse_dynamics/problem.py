"""Least-squares problem of inverse dynamics: parameters, and the recorded channel that shows the torque."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array, rms
from emaphm.estimation.inverse_dynamics.filtering import RowThinning
from emaphm.estimation.inverse_dynamics.motion import Motion
from emaphm.estimation.inverse_dynamics.torque_balance import (
    Values,
    required_torque,
    response,
)

Key = tuple[str, int | None]
"""Name of a free parameter, and the index of its recording; None if it is common to all recordings."""

DIFFERENCE = 1e-3
"""Step of the central differences, relative to a parameter's scale; exact for a linear model."""

LEAST_SHARE = 1e-3
"""Lower limit of a parameter's scale, relative to its described value."""


@dataclass(frozen=True, eq=False)
class InverseProblem:
    """Free parameters `keys` of `motions`, described and known values, and the weight of each recording.

    A point (p,) contains a value for each key; for static friction, this is its excess over Coulomb friction,
    which is not negative. `targets` are the recorded channels in the regression's rows.
    """

    motions: tuple[Motion, ...]
    thinnings: tuple[RowThinning, ...]
    targets: tuple[Array, ...]
    described: Values
    known: tuple[Values, ...]
    keys: tuple[Key, ...]
    ripple_orders: tuple[float, ...]
    weights: tuple[float, ...]

    @classmethod
    def of(
        cls,
        motions: Sequence[Motion],
        described: Values,
        free: Sequence[str],
        known: Sequence[Values],
        per_recording: tuple[str, ...],
        ripple_orders: tuple[float, ...],
    ) -> Self:
        """Return the problem with each recording weighted by the inverse of its rms."""
        thinnings = tuple(
            RowThinning.of(motion.moving, motion.frequencies.regression_hz, motion.interval)
            for motion in motions
        )
        targets = tuple(thinned(motion.response) for thinned, motion in zip(thinnings, motions, strict=True))
        keys: list[Key] = [(name, None) for name in free if name not in per_recording]
        for name in per_recording:
            # A common factor on all torque constants would only scale the other parameters.
            first = 1 if name == "torque_constant" else 0
            keys += [(name, i) for i in range(first, len(motions)) if name not in known[i]]
        return cls(
            tuple(motions),
            thinnings,
            targets,
            described,
            tuple(known),
            tuple(keys),
            ripple_orders,
            tuple(1 / max(rms(target), np.finfo(float).tiny) for target in targets),
        )

    @property
    def labels(self) -> tuple[str, ...]:
        """The names of the keys for messages."""
        return tuple(name if i is None else f"{name} of {self.motions[i].source}" for name, i in self.keys)

    @property
    def start(self) -> Array:
        """The description as a point, shape (p,)."""
        described = {name: self.described.get(name, 0.0) for name, _ in self.keys}
        if "static" in described:
            described["static"] -= self.described.get("coulomb", 0.0)
        return np.array([described[name] for name, _ in self.keys])

    def reweighted(self, point: Array) -> Self:
        """Return the problem with each recording weighted by the inverse of its residual at `point` (p,)."""
        sizes = [
            max(rms(target - self.predicted(point, i)), 1e-6 * rms(target))
            for i, target in enumerate(self.targets)
        ]
        return replace(self, weights=tuple(1 / size for size in sizes))

    def values(self, point: Array, recording: int) -> dict[str, float]:
        """Return all parameters of the recording with the index `recording` at `point` (p,), by name."""
        own = {
            name: float(value)
            for (name, i), value in zip(self.keys, point, strict=True)
            if i in (None, recording)
        }
        values = {**self.described, **own, **self.known[recording]}
        if "static" in self.known[recording]:
            return values
        coulomb, static = self.described.get("coulomb", 0.0), self.described.get("static", 0.0)
        if "static" in own:
            values["static"] = values["coulomb"] + own["static"]
        elif coulomb > 0:
            values["static"] = static / coulomb * values["coulomb"]
        return values

    def parameters(self, point: Array) -> Array:
        """Return the values of the free parameters at `point` (p,), shape (p,)."""
        values = point.copy()
        for k, (name, recording) in enumerate(self.keys):
            if name != "static":
                continue
            shared = {key: value for (key, i), value in zip(self.keys, point, strict=True) if i is None}
            by_name = {**self.described, **shared} if recording is None else self.values(point, recording)
            values[k] += by_name["coulomb"]
        return values

    def parameter_covariance(self, covariance: Array) -> Array:
        """Return the free parameters' covariance (p, p) from that of a point, in which they are linear."""
        origin = self.parameters(np.zeros(len(self.keys)))
        effects = np.stack([self.parameters(unit) - origin for unit in np.eye(len(self.keys))], axis=1)
        return np.asarray(effects @ covariance @ effects.T)

    def torque(self, point: Array, recording: int) -> Array:
        """Return the motor's torque (n,) [N·m] that the motion of a recording requires, in every row."""
        return required_torque(self.motions[recording], self.values(point, recording), self.ripple_orders)

    def predicted(self, point: Array, recording: int) -> Array:
        """Return the predicted channel of a recording at `point` (p,), in the regression's rows."""
        motion = self.motions[recording]
        full = response(motion, self.torque(point, recording), self.values(point, recording))
        return self.thinnings[recording](full)

    def residual(self, point: Array) -> Array:
        """Return the weighted residuals, measured minus predicted, of all recordings, shape (rows,)."""
        return np.concatenate(
            [
                weight * (target - self.predicted(point, i))
                for i, (weight, target) in enumerate(zip(self.weights, self.targets, strict=True))
            ]
        )

    def jacobian(self, point: Array, chosen: NDArray[np.bool_] | None = None) -> Array:
        """Return the derivatives of the weighted prediction by the `chosen` parameters, shape (rows, chosen).

        Central differences at `point` (p,) are exact for parameters in which the balance is linear.
        """
        columns, start = [], self.start
        for k in range(point.size) if chosen is None else np.flatnonzero(chosen):
            step = np.zeros(point.size)
            step[k] = DIFFERENCE * (max(abs(point[k]), LEAST_SHARE * abs(start[k])) or 1.0)
            columns.append((self.residual(point - step) - self.residual(point + step)) / (2 * step[k]))
        return np.stack(columns, axis=1)
