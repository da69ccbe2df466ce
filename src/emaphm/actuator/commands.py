"""Position commands: functions of time that an actuator follows."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from emaphm.actuator.channels import CommandHeld
from emaphm.arrays import Array, floats
from emaphm.errors import SignalError

Command = Callable[[Array], Array]
"""Function of times [s], shape (n,), that returns user positions [rad; m if linear], shape (n,)."""


ROUNDING = 1e-9
"""Distance from a row, in intervals, within which a time counts as that of the row."""


def _check_finite(command: object, *names: str) -> None:
    """Raise `SignalError` for a value that is not finite, which cannot be simulated."""
    for name in names:
        value = getattr(command, name)
        if not math.isfinite(value):
            raise SignalError(
                f"{name} of a {type(command).__name__} is {value:g}, which is no finite number; give one"
            )


def _check_sweep(chirp: "Chirp | DecayingChirp") -> None:
    if not chirp.duration > 0:
        raise SignalError(f"a chirp of {chirp.duration:g} s sweeps nothing; give a duration above 0")
    _check_finite(chirp, "amplitude", "start_hz", "stop_hz", "duration", "about")


@dataclass(frozen=True)
class Step:
    """Step from 0 to `amplitude` [rad; m if linear] at `start` [s], relative to the position `about`.

    Raises
    ------
    SignalError
        A value is not finite.
    """

    amplitude: float = 5e-3
    start: float = 0.0
    about: float = 0.0

    def __post_init__(self) -> None:
        _check_finite(self, "amplitude", "start", "about")

    def __call__(self, t: Array) -> Array:
        """Return the command [rad; m if linear] at times `t` [s], (n,)."""
        return self.about + np.where(t >= self.start, self.amplitude, 0.0)


@dataclass(frozen=True)
class Ramp:
    """Ramp of a constant `rate` [rad/s; m/s if linear] from `start` [s] until ±`limit` [rad; m], then held.

    Ramp and limit are relative to the position `about` [rad; m].

    Raises
    ------
    SignalError
        The rate, the start or the position is not finite, or the limit not above 0.
    """

    rate: float = 2e-2
    start: float = 0.0
    limit: float = np.inf
    about: float = 0.0

    def __post_init__(self) -> None:
        _check_finite(self, "rate", "start", "about")
        if not self.limit > 0:
            raise SignalError(
                f"a ramp's limit is a size, not {self.limit:g}; give one above 0, and its sign by the rate"
            )

    def __call__(self, t: Array) -> Array:
        """Return the command [rad; m if linear] at times `t` [s], (n,)."""
        return self.about + np.clip(self.rate * np.maximum(t - self.start, 0.0), -self.limit, self.limit)


@dataclass(frozen=True)
class Sine:
    """Sine about + amplitude × sin(2 pi frequency t); position and amplitude in rad, m if linear.

    Raises
    ------
    SignalError
        A value is not finite.
    """

    amplitude: float = 5e-3
    frequency_hz: float = 4.0
    about: float = 0.0

    def __post_init__(self) -> None:
        _check_finite(self, "amplitude", "frequency_hz", "about")

    def __call__(self, t: Array) -> Array:
        """Return the command [rad; m if linear] at times `t` [s], (n,)."""
        return self.about + self.amplitude * np.sin(2 * np.pi * self.frequency_hz * t)


@dataclass(frozen=True)
class Chirp:
    """Linear chirp from `start_hz` to `stop_hz` over `duration` [s]; the default manoeuvre.

    about + amplitude × sin(2 pi (f0 t + (f1 - f0) t² / (2 duration))); position and amplitude in rad, m if
    linear, frequencies in Hz. After `duration` the frequency continues to rise.

    Raises
    ------
    SignalError
        A value is not finite, or the duration not above 0.
    """

    amplitude: float = 5e-3
    start_hz: float = 0.0
    stop_hz: float = 15.0
    duration: float = 0.5
    about: float = 0.0

    def __post_init__(self) -> None:
        _check_sweep(self)

    def __call__(self, t: Array) -> Array:
        """Return the command [rad; m if linear] at times `t` [s], (n,)."""
        sweep = (self.stop_hz - self.start_hz) / (2 * self.duration)
        return self.about + self.amplitude * np.sin(2 * np.pi * (self.start_hz + sweep * t) * t)


@dataclass(frozen=True)
class DecayingChirp:
    """The thesis's second chirp (3.1.1): a `Chirp` times a factor that falls linearly from 1 to 0.

    Raises
    ------
    SignalError
        A value is not finite, or the duration not above 0.
    """

    amplitude: float = 5e-3
    start_hz: float = 0.0
    stop_hz: float = 15.0
    duration: float = 0.5
    about: float = 0.0

    def __post_init__(self) -> None:
        _check_sweep(self)

    def __call__(self, t: Array) -> Array:
        """Return the command [rad; m if linear] at times `t` [s], (n,)."""
        chirp = Chirp(self.amplitude, self.start_hz, self.stop_hz, self.duration)
        return self.about + chirp(t) * np.clip(1 - t / self.duration, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Sampled:
    """A signal given by samples, with linear interpolation between them and held at both ends.

    Parameters
    ----------
    time_s
        Increasing times [s], shape (n,), n at least 2.
    values
        Values of the signal at these times, shape (n,), in its own unit.

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
        # A copied array would be writeable; the constructor makes it read-only again.
        return Sampled, (self.time_s, self.values)

    def __call__(self, t: Array) -> Array:
        """Return the signal at times `t` [s]."""
        return np.interp(t, self.time_s, self.values)


def sample_held(command: Command, interval: float, sent: CommandHeld | None) -> Command:
    """Return a `command` as held by a drive that receives it at multiples of `interval` [s].

    If it is `sent` "before" the row of that time is read, it acts in this row; "after", the earlier command
    still acts then. With None, the drive receives it continuously.
    """
    if sent is None:
        return command

    def value(times: Array) -> Array:
        # Times of model steps are multiples of a fraction of the interval: rounding must not lose a row.
        rows = times / interval
        received = np.floor(rows + ROUNDING) if sent == "before" else np.ceil(rows - ROUNDING) - 1
        return command(np.maximum(received, 0.0) * interval)

    return value


def rest_position(command: Command, given: float | None = None) -> float:
    """Return the position of the shaft at rest before `command` [rad; m if linear].

    It is `given`, else the position `about` of the command, else 0, for example for `Sampled`.
    """
    return float(getattr(command, "about", 0.0)) if given is None else given


Load = float | Command
"""A constant load [N·m; N if linear] at the motor shaft, or a function of time such as `Sampled`."""
