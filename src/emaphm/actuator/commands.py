"""Position commands: functions of time that a test rig follows."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from emaphm.arrays import Array, floats
from emaphm.errors import SignalError

Command = Callable[[Array], Array]
"""Anything that maps times [s], shape (n,), to user positions [rad], shape (n,)."""


@dataclass(frozen=True)
class Step:
    """`amplitude` [rad] from `start` [s] on, 0 before."""

    amplitude: float = 5e-3
    start: float = 0.0

    def __call__(self, t: Array) -> Array:
        """Return the command [rad] at times `t` [s]."""
        return np.where(t >= self.start, self.amplitude, 0.0)


@dataclass(frozen=True)
class Ramp:
    """Constant `rate` [rad/s] from `start` [s] on, held once ±`limit` [rad], above 0, is reached."""

    rate: float = 2e-2
    start: float = 0.0
    limit: float = np.inf

    def __post_init__(self) -> None:
        """Refuse a limit that is not positive with `SignalError`."""
        if not self.limit > 0:
            raise SignalError(
                f"a ramp's limit is a size, not {self.limit:g}; give one above 0, and its sign by the rate"
            )

    def __call__(self, t: Array) -> Array:
        """Return the command [rad] at times `t` [s]."""
        return np.clip(self.rate * np.maximum(t - self.start, 0.0), -self.limit, self.limit)


@dataclass(frozen=True)
class Sine:
    """amplitude × sin(2 pi frequency t); amplitude in rad, frequency in Hz."""

    amplitude: float = 5e-3
    frequency_hz: float = 4.0

    def __call__(self, t: Array) -> Array:
        """Return the command [rad] at times `t` [s]."""
        return self.amplitude * np.sin(2 * np.pi * self.frequency_hz * t)


@dataclass(frozen=True)
class Chirp:
    """Linear chirp from `start_hz` to `stop_hz` over `duration` [s]; the default manoeuvre.

    amplitude × sin(2 pi (f0 t + (f1 - f0) t² / (2 duration))); amplitude in rad.
    """

    amplitude: float = 5e-3
    start_hz: float = 0.0
    stop_hz: float = 15.0
    duration: float = 0.5

    def __post_init__(self) -> None:
        """Refuse a duration that is not positive with `SignalError`."""
        if not self.duration > 0:
            raise SignalError(f"a chirp of {self.duration:g} s sweeps nothing; give a duration above 0")

    def __call__(self, t: Array) -> Array:
        """Return the command [rad] at times `t` [s]."""
        sweep = (self.stop_hz - self.start_hz) / (2 * self.duration)
        return self.amplitude * np.sin(2 * np.pi * (self.start_hz + sweep * t) * t)


@dataclass(frozen=True)
class DecayingChirp:
    """The thesis's second chirp (3.1.1): as `Chirp`, its amplitude falling linearly from 1 to 0 times."""

    amplitude: float = 5e-3
    start_hz: float = 0.0
    stop_hz: float = 15.0
    duration: float = 0.5

    def __call__(self, t: Array) -> Array:
        """Return the command [rad] at times `t` [s]."""
        chirp = Chirp(self.amplitude, self.start_hz, self.stop_hz, self.duration)
        return chirp(t) * np.clip(1 - t / self.duration, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Sampled:
    """A signal given by samples, linear between them and held at both ends.

    Parameters
    ----------
    time_s
        Increasing times [s], shape (n,), n at least 2.
    values
        The signal there, shape (n,), in its own unit.

    Raises
    ------
    SignalError
        Shapes differ, times do not increase, or a value is not finite.
    """

    time_s: Array = field(repr=False)
    values: Array = field(repr=False)

    def __init__(self, time_s: ArrayLike, values: ArrayLike) -> None:
        try:
            t, v = floats(time_s), floats(values)
        except TypeError as error:
            raise SignalError(f"a sampled signal is {error}") from None
        if t.ndim != 1 or t.shape != v.shape or t.size < 2:
            raise SignalError(
                f"a sampled signal needs two equal columns of 2 rows or more, got {t.shape}, {v.shape}"
            )
        bad = np.flatnonzero(~(np.isfinite(t) & np.isfinite(v)))
        if bad.size:
            raise SignalError(f"row {bad[0] + 1} of the sampled signal is not finite; correct or drop it")
        late = np.flatnonzero(np.diff(t) <= 0)
        if late.size:
            raise SignalError(f"times of a sampled signal must increase; row {late[0] + 2} does not")
        t.flags.writeable = v.flags.writeable = False
        object.__setattr__(self, "time_s", t)
        object.__setattr__(self, "values", v)

    def __reduce__(self) -> tuple[Any, ...]:
        # Copies of an array can be written to: those of a signal are made anew.
        return Sampled, (self.time_s, self.values)

    def __call__(self, t: Array) -> Array:
        """Return the signal at times `t` [s]."""
        return np.interp(t, self.time_s, self.values)


Load = float | Command
"""A constant load [N·m] at the motor shaft, or a function of time such as `Sampled`."""
