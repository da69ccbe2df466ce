"""Inputs of a run at each step: command, load and noise; and the sampling of its output."""

import math
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from emaphm.actuator import Command, Load
from emaphm.actuator.channels import SAMPLINGS, Sampling
from emaphm.arrays import Array
from emaphm.errors import SignalError, nearest
from emaphm.random_streams import stream

MOST_AT_ONCE = 5_000_000
"""Largest number of steps at which a signal is evaluated in one call; each step takes about 40 bytes."""

LARGEST_SIGNAL = 1e15
"""Largest command [rad] or load [N·m]: products of larger values exceed the range of float64."""


@dataclass(frozen=True)
class Inputs:
    """Command [rad], load [N·m], noise on the reference current [A] and enabling of the drive at each step.

    Each signal has shape (samples × substeps,) and type float64; `enabled` is 1 (on) or 0 (off). `interval`
    [s] is the sample interval. A row of output is the mean over its interval or the value at its start,
    according to `sampling`.

    Raises
    ------
    SignalError
        A signal has another shape or type, or `sampling` is unknown.
    """

    command: Array
    load: Array
    noise: Array
    samples: int
    substeps: int
    interval: float
    enabled: Array
    sampling: Sampling = "mean"

    def __post_init__(self) -> None:
        """Check shapes and types: a kernel reads the signals without a check of their length."""
        if self.sampling not in SAMPLINGS:
            raise SignalError(f"unknown sampling '{self.sampling}'{nearest(str(self.sampling), SAMPLINGS)}")
        steps = self.samples * self.substeps
        for name in ("command", "load", "noise", "enabled"):
            signal = getattr(self, name)
            if signal.shape != (steps,) or signal.dtype != np.float64:
                raise SignalError(
                    f"the {name} of a run is {signal.dtype} of shape {signal.shape}; give {steps} floats"
                )

    @classmethod
    def of(
        cls,
        command: Command,
        load: Load = 0.0,
        *,
        samples: int,
        interval: float,
        step: float,
        sampling: Sampling = "mean",
        noise: float = 0.0,
        enabled: Command | None = None,
        seed: int = 0,
    ) -> Self:
        """Return the inputs, evaluated at every step.

        Parameters
        ----------
        command, load
            Functions of time [s]; the load may be a number.
        samples, interval
            Number of rows of the output, and their interval [s].
        step
            Longest integration step [s]; the largest step up to it that divides `interval` is used.
        noise
            White noise on the reference current, rms [A] at each step (thesis 4.1), drawn from `seed`.
        enabled
            Function of time [s]: 1 while the drive is on, 0 while the motor is without current. Default: 1.

        Raises
        ------
        SignalError
            The number of samples, the interval or the step is not positive, the noise is negative, or command
            or load is not one finite value per step.
        """
        if samples < 1 or not interval > 0 or not step > 0:
            raise SignalError(
                f"a run needs samples ({samples}), interval ({interval:g} s) and step ({step:g} s) above 0"
            )
        if not 0 <= noise < math.inf:
            raise SignalError(f"noise on the reference current, {noise:g} A, is not an rms; give 0 or more")
        substeps = max(1, math.ceil(interval / step * (1 - 1e-9)))
        steps = samples * substeps
        step = interval / substeps
        zero = np.broadcast_to(0.0, steps)
        rng = stream(seed, "controller noise")
        return cls(
            command=_evaluated("command", command, steps, step),
            load=_evaluated("load", load, steps, step)
            if callable(load)
            else _checked("load", np.broadcast_to(float(load), steps), steps),
            noise=rng.normal(0.0, noise, steps) if noise else zero,
            samples=samples,
            substeps=substeps,
            interval=interval,
            enabled=np.broadcast_to(1.0, steps)
            if enabled is None
            else _evaluated("enabling", enabled, steps, step),
            sampling=sampling,
        )

    @property
    def step(self) -> float:
        """Integration step [s]."""
        return self.interval / self.substeps

    @property
    def duration(self) -> float:
        """Duration of the run [s]."""
        return self.samples * self.interval

    @property
    def window(self) -> int:
        """Number of steps, from the start of each interval, over which a row is the mean."""
        return self.substeps if self.sampling == "mean" else 1

    @property
    def time_s(self) -> Array:
        """Time stamps of the rows, shape (samples,) [s]."""
        return np.asarray(np.arange(self.samples) * self.interval)

    def rows(self, values: Array) -> Array:
        """Return values at every step, shape (samples × substeps,), as rows of output, shape (samples,)."""
        return np.asarray(values.reshape(self.samples, self.substeps)[:, : self.window].mean(axis=1))


def _evaluated(what: str, signal: Command, steps: int, step: float) -> Array:
    """Return a signal at every step, (steps,); in parts of `MOST_AT_ONCE`, to limit the memory."""
    if steps <= MOST_AT_ONCE:
        return _checked(what, signal(np.asarray(np.arange(steps) * step)), steps)
    values = np.empty(steps)
    for first in range(0, steps, MOST_AT_ONCE):
        index = np.arange(first, min(first + MOST_AT_ONCE, steps))
        values[first : first + index.size] = _checked(what, signal(np.asarray(index * step)), index.size)
    return values


def _checked(what: str, values: Any, steps: int) -> Array:
    if np.shape(values) != (steps,):
        raise SignalError(f"the {what} gave {np.shape(values)} values for {steps} times; give one for each")
    if not np.all(np.isfinite(values)):
        raise SignalError(f"the {what} is not finite everywhere; correct its values")
    largest = float(np.max(np.abs(values)))
    if largest > LARGEST_SIGNAL:
        raise SignalError(f"the {what} reaches {largest:.4g}, beyond any actuator; give it in its SI unit")
    return np.asarray(values, float)
