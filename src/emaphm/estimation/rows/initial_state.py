"""Initial state of a recorded manoeuvre: the motor's angle and speed, and the rotor's electrical zero."""

from dataclasses import dataclass
from typing import Self, TypeAlias

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array, rms
from emaphm.estimation.sensors.counts import ROUNDING, visible_count
from emaphm.estimation.sensors.sensor_model import true_values
from emaphm.estimation.space.nuisances import usual_deviation
from emaphm.recording import Recording, reconstructed
from emaphm.recording.noise import noise_level
from emaphm.simulation import Initial
from emaphm.simulation.laws.angles import wrap

KNOWN = 0.01
"""Largest standard error of the speed at the start, relative to the motor's rms speed, at which the speed
counts as known."""

SIGNIFICANT = 3.0
"""Number of standard errors by which a position or speed must differ from its default to replace it."""

FIRST_ROWS = (10, 20, 40, 80)
"""Numbers of rows from which the starting speed is estimated: the largest whose residual from a parabola is
within the noise is used."""

SHORTEST_ROWS = 4
"""Number of rows in which a speed must be visible alone; the first of `FIRST_ROWS` if counts are visible."""

NOISE_OF_SECOND_DIFFERENCES = (70 / 6) ** 0.5
"""Ratio of `noise_level` of second differences to `noise_level` of the rows: the root of the ratio of the
sums of squared coefficients of fourth and second differences."""

CUBIC_SIGNIFICANT = 2.0
"""Least speed from a cubic, in its standard errors, in the direction of the speed from a parabola."""

Speed: TypeAlias = tuple[float, float]
"""A speed of the motor and its standard error [rad/s]."""

RANDOM_RESIDUAL = 1.5
"""Largest ratio of the residual from a parabola to the noise of the rows at which it counts as noise."""


def initial_state(recording: Recording, actuator: Actuator) -> Initial:
    """Return the initial state of the recorded manoeuvre.

    The user starts at its recorded position. It starts on the command if its position was not recorded, or if
    the difference is within the sensor's noise or one count. The motor starts in the middle of the backlash
    gap. A position beyond an end stop within the sensor's usual zero error is replaced by the end stop.
    Without a position, the motor's angle is used. If the recording does not determine the initial motion, the
    first rows are not compared (`emaphm.estimation.rows.unknown_start`).
    """
    ratio = actuator.mechanics.gear_ratio
    motion = _FirstMotion.of(recording, actuator)
    speed = _starting_speed(motion) if motion else 0.0
    # The command at t = 0: a row that is a mean is valid half an interval later.
    position = float(reconstructed(recording, "command_rad")(np.zeros(1))[0])
    if "position_rad" in recording:
        measured = true_values(recording["position_rad"], "position_rad", actuator)
        shown = _rows_from_start(recording, actuator, "position_rad")
        moves = motion is not None and speed and shown[0][-1] >= 0
        first = _starting_position(motion, *shown, ratio) if motion and moves else float(measured[0])
        if abs(first - position) > max(SIGNIFICANT * noise_level(measured), visible_count(measured)):
            position = _within_stops(first, actuator)
    angle = position / ratio
    offset = _rotor_offset(recording, actuator) if "angle_rad" in recording else 0.0
    if "angle_rad" in recording and "position_rad" not in recording:
        angle += float(wrap(_starting_angle(recording, actuator, speed) - offset - angle))
    return Initial(angle, speed, offset)


def _starting_position(motion: "_FirstMotion", time: Array, measured: Array, ratio: float) -> float:
    """Return the user's position [rad] at the start of a motion, from its `measured` rows (n,) at `time`.

    It is the mean over the rows from which the speed is estimated, minus the distance since the start
    according to their parabola: a single row has an error of noise and half a count, which the position gain
    converts to a speed.
    """
    rows = motion.chosen
    since = motion.time[:rows] - motion.origin
    parabola = np.polynomial.Polynomial(np.polyfit(since, motion.column[:rows], 2)[::-1])
    if motion.order:
        return float(parabola(-motion.origin))
    distance = ratio * parabola.integ(lbnd=-motion.origin)(time[:rows] - motion.origin)
    return float(np.mean(measured[:rows] - distance))


def _motor_angle(recording: Recording, actuator: Actuator) -> tuple[Array, Array]:
    """Return the times (n,) [s] of `_shown_times`, and the motor's recorded angle (n,) [rad], continuous."""
    angle = true_values(np.unwrap(recording["angle_rad"]), "angle_rad", actuator)
    return _shown_times(recording, actuator, "angle_rad"), angle


def _starting_angle(recording: Recording, actuator: Actuator, speed: float) -> float:
    """Return the recorded angle [rad] of the motor at the start, at which it has this `speed` [rad/s]."""
    time, angle = _motor_angle(recording, actuator)
    if not speed:
        return float(angle[0])
    # A late sensor shows the start in a later row; without delay, the first row is half an interval late.
    return float(np.interp(0.0, time, angle) - speed * max(time[0], 0.0))


def _within_stops(position: float, actuator: Actuator) -> float:
    """Return `position` [rad], or the end stop if the sensor's usual zero error explains the excess."""
    if actuator.mechanics.end_stops is None:
        return position
    inside = float(np.clip(position, *actuator.mechanics.end_stops))
    usual = usual_deviation(actuator, "position_offset")
    return inside if abs(inside - position) <= SIGNIFICANT * usual else position


def _first_time(recording: Recording) -> float:
    """Return the time of the first row after the start [s]: half an interval if rows are means, else 0."""
    return recording.interval_s / 2 if recording.sampling == "mean" else 0.0


def _shown_times(recording: Recording, actuator: Actuator, name: str) -> Array:
    """Return the times (n,) [s] since the start at which a channel had the values of its rows.

    A described sensor shows them later by its delay, and in a steady motion by its lag: its first rows are of
    the motion before the start.
    """
    sensor = actuator.sensors.of(name)
    since = recording["time_s"] - recording["time_s"][0] + _first_time(recording)
    return np.asarray(since - (sensor.delay + sensor.lag))


def _rows_from_start(recording: Recording, actuator: Actuator, name: str) -> tuple[Array, Array]:
    """Return the `_shown_times` (n,) [s] of a channel and its true values (n,), without its delay's rows.

    A polynomial through the rows of a late sensor before the start would have to be extrapolated. The rows of
    a lag are kept: only in a steady motion they are those of an earlier time.
    """
    time = _shown_times(recording, actuator, name)
    first = max(int(np.searchsorted(time, -actuator.sensors.of(name).lag, side="right")) - 1, 0)
    return time[first:], true_values(recording[name], name, actuator)[first:]


def _rotor_offset(recording: Recording, actuator: Actuator) -> float:
    """Return the motor's angle minus the user's [rad]; 0 if backlash, noise or lag can be the cause."""
    ratio = actuator.mechanics.gear_ratio
    time, motor = _motor_angle(recording, actuator)
    # Within the gap, the motor is up to half its width ahead of the user or behind it.
    tolerance = actuator.mechanics.backlash * (1 + actuator.faults.backlash) / 2
    tolerance += SIGNIFICANT * noise_level(motor)
    if "position_rad" in recording:
        user = true_values(recording["position_rad"], "position_rad", actuator) / ratio
        user_time = _shown_times(recording, actuator, "position_rad")
        tolerance += SIGNIFICANT * noise_level(user)
    else:
        user, user_time = recording["command_rad"] / ratio, _shown_times(recording, actuator, "command_rad")
    # The two sensors may have different delays.
    common = (time >= user_time[0]) & (time <= user_time[-1])
    if not common.any():
        return 0.0
    distances = (motor - np.interp(time, user_time, user))[common]
    if "position_rad" not in recording:
        tolerance += float(np.ptp(distances)) / 4
    distance = float(wrap(distances[0] + np.median(wrap(distances - distances[0]))))
    return distance if abs(distance) > tolerance else 0.0


def shows_start(recording: Recording, actuator: Actuator) -> bool:
    """Return whether `recording` determines position and speed at its start; a speed alone does not.

    The standard error of the speed must be at most `KNOWN` of the rms speed.
    """
    if not ("position_rad" in recording or ("angle_rad" in recording and "speed_rad_s" in recording)):
        return False
    usual = rms(np.diff(recording["command_rad"])) / recording.interval_s
    motion = _FirstMotion.of(recording, actuator)
    if motion is None:
        return False
    _, error = motion.speed(motion.chosen, 2)
    return error <= KNOWN * usual / actuator.mechanics.gear_ratio


def _starting_speed(motion: "_FirstMotion") -> float:
    """Return the motor's speed [rad/s] at the start, 0 if it is not significant.

    A polynomial of one degree more and the first few rows alone must confirm the speed: a polynomial through
    the rows of a shaft that first sticks and then moves has a speed at the start although the shaft stands.
    """
    (speed, error), (cubic, cubic_error) = motion.speed(motion.chosen, 2), motion.speed(motion.chosen, 3)
    first, first_error = motion.at_once
    cubic_agrees = speed * cubic > 0 and abs(cubic) > CUBIC_SIGNIFICANT * cubic_error
    first_agrees = abs(first - speed) <= max(SIGNIFICANT * first_error, abs(speed) / 2)
    return speed if abs(speed) > SIGNIFICANT * error and cubic_agrees and first_agrees else 0.0


@dataclass(frozen=True, eq=False)
class _FirstMotion:
    """The channel from which the motor's initial speed is estimated, by polynomials through the first rows.

    `column` (n,) at `time` (n,) [s] from the start (`_shown_times`) is the motor's speed if `order` is 0, the
    user's position if `order` is 1: the speed [rad/s] is then `scale` times its slope. `noise` is the rms
    noise of a row, `count` the step of the converter (0 if not visible), both in the unit of `column`.
    """

    time: Array
    column: Array
    order: int
    scale: float
    noise: float
    count: float

    @classmethod
    def of(cls, recording: Recording, actuator: Actuator) -> Self | None:
        """Return the first motion from a recorded speed, or else from a position.

        None without either, or if a late sensor shows too few rows after the start.
        """
        if "speed_rad_s" in recording and not actuator.sensors.speed_rad_s.unsigned:
            name, order, scale = "speed_rad_s", 0, 1.0
        elif "position_rad" in recording:
            name, order, scale = "position_rad", 1, 1 / actuator.mechanics.gear_ratio
        else:
            return None
        time, column = _rows_from_start(recording, actuator, name)
        if column.size < FIRST_ROWS[0]:
            return None
        count = visible_count(column)
        noise = max(noise_level(np.diff(column, 2)) / NOISE_OF_SECOND_DIFFERENCES, count / ROUNDING)
        return cls(time, column, order, scale, noise, count)

    @property
    def origin(self) -> float:
        """The time [s] from which polynomials are computed: far from their rows, they would be singular."""
        return min(float(self.time[0]), 0.0)

    @property
    def chosen(self) -> int:
        """The largest number of first rows whose residual from a parabola is within the noise.

        A coarse converter resolves a speed only over many rows, in which the acceleration must not change.
        """
        chosen = FIRST_ROWS[0]
        for rows in FIRST_ROWS[1:]:
            if rows > self.column.size or self._residual(rows, 2) > RANDOM_RESIDUAL * self.noise:
                break
            chosen = rows
        return chosen

    def speed(self, rows: int, degree: int) -> Speed:
        """Return the speed at the start from a polynomial of this `degree` through the first `rows`."""
        since = self.time[:rows] - self.origin
        coefficients, covariance = np.polyfit(since, self.column[:rows], degree, cov="unscaled")
        powers = np.arange(degree, -1, -1)
        # The derivative of `order` of each power at the start.
        terms = powers**self.order * (-self.origin) ** np.maximum(powers - self.order, 0.0)
        error = max(self._residual(rows, degree), self.noise) * float((terms @ covariance @ terms) ** 0.5)
        return self.scale * float(terms @ coefficients), self.scale * error

    @property
    def at_once(self) -> Speed:
        """The speed from the first few rows alone."""
        rows = FIRST_ROWS[0] if self.count else SHORTEST_ROWS
        slope, covariance = np.polyfit(self.time[:rows], self.column[:rows], self.order, cov="unscaled")
        return self.scale * float(slope[0]), self.scale * self.noise * float(covariance[0, 0] ** 0.5)

    def _residual(self, rows: int, degree: int) -> float:
        """Return the rms residual of the first `rows` from a polynomial of this `degree`."""
        time, column = self.time[:rows] - self.origin, self.column[:rows]
        return rms(column - np.polyval(np.polyfit(time, column, degree), time))
