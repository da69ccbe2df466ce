"""The least-squares problem of inverse dynamics: parameters against the channel that shows the torque."""

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
"""A free parameter's name, and the number of the recording that it belongs to, if to one."""

DIFFERENCE = 1e-3
"""Step of the central differences, relative to a parameter's scale: exact where the model is linear."""

LEAST_SHARE = 1e-3
"""Least size of a parameter that its step follows, relative to its description."""


@dataclass(frozen=True, eq=False)
class InverseProblem:
    """Free parameters `keys` of `motions`, described and known values, and the weight of each recording.

    A point (p,) holds a value for each key; for static friction that by which it exceeds Coulomb friction,
    which cannot be below 0. `targets` are the recorded channels of the regression's rows.
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
        """Return the problem, each recording weighted by the inverse of its rms at first."""
        thinnings = tuple(
            RowThinning.of(motion.moving, motion.frequencies.regression_hz, motion.interval)
            for motion in motions
        )
        targets = tuple(thinned(motion.response) for thinned, motion in zip(thinnings, motions, strict=True))
        keys: list[Key] = [(name, None) for name in free if name not in per_recording]
        for name in per_recording:
            # All torque constants together would only scale the other parameters.
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
        """The keys in words."""
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
        """Return all parameters of a recording, by number, at `point` (p,)."""
        own = {
            name: float(value)
            for (name, i), value in zip(self.keys, point, strict=True)
            if i in (None, recording)
        }
        found = {**self.described, **own, **self.known[recording]}
        if "static" in self.known[recording]:
            return found
        dry, still = self.described.get("coulomb", 0.0), self.described.get("static", 0.0)
        if "static" in own:
            found["static"] = found["coulomb"] + own["static"]
        elif dry > 0:
            found["static"] = still / dry * found["coulomb"]
        return found

    def parameters(self, point: Array) -> Array:
        """Return the values of the free parameters at `point` (p,), shape (p,)."""
        values = point.copy()
        for k, (name, recording) in enumerate(self.keys):
            if name != "static":
                continue
            shared = {other: value for (other, i), value in zip(self.keys, point, strict=True) if i is None}
            others = {**self.described, **shared} if recording is None else self.values(point, recording)
            values[k] += others["coulomb"]
        return values

    def parameter_covariance(self, covariance: Array) -> Array:
        """Return the free parameters' covariance (p, p) for that of a point, in which they are linear."""
        origin = self.parameters(np.zeros(len(self.keys)))
        effects = np.stack([self.parameters(one) - origin for one in np.eye(len(self.keys))], axis=1)
        return np.asarray(effects @ covariance @ effects.T)

    def torque(self, point: Array, recording: int) -> Array:
        """Return the motor's torque that the motion of a recording requires, every row (n,) [N·m]."""
        return required_torque(self.motions[recording], self.values(point, recording), self.ripple_orders)

    def predicted(self, point: Array, recording: int) -> Array:
        """Return the recorded channel at `point` (p,) in the regression's rows of a recording."""
        motion = self.motions[recording]
        full = response(motion, self.torque(point, recording), self.values(point, recording))
        return self.thinnings[recording](full)

    def residual(self, point: Array) -> Array:
        """Return measured less predicted of all recordings, weighted, end to end, shape (rows,)."""
        return np.concatenate(
            [
                weight * (target - self.predicted(point, i))
                for i, (weight, target) in enumerate(zip(self.weights, self.targets, strict=True))
            ]
        )

    def jacobian(self, point: Array, chosen: NDArray[np.bool_] | None = None) -> Array:
        """Return the derivatives of the weighted prediction by the `chosen` parameters, shape (rows, chosen).

        By central differences at `point` (p,): exact for the parameters that the balance is linear in.
        """
        found, start = [], self.start
        for k in range(point.size) if chosen is None else np.flatnonzero(chosen):
            step = np.zeros(point.size)
            step[k] = DIFFERENCE * (max(abs(point[k]), LEAST_SHARE * abs(start[k])) or 1.0)
            found.append((self.residual(point - step) - self.residual(point + step)) / (2 * step[k]))
        return np.stack(found, axis=1)
