"""Where a recorded manoeuvre starts: the motor's angle and speed, and the rotor's electrical zero."""

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
"""Standard error of the speed at the start, relative to the motor's rms speed, up to which it is known."""

SIGNIFICANT = 3.0
"""Standard errors by which a position or speed must differ from its default to be taken instead."""

FIRST_ROWS = (10, 20, 40, 80)
"""Rows that the starting speed is estimated from: the most of which a parabola leaves no more than noise."""

AT_ONCE = 4
"""Rows in which a speed must show by itself; the first of `FIRST_ROWS` where counts are visible."""

STEEPER = (70 / 6) ** 0.5
"""What `noise_level` has of second differences, over that of the rows: the root of 70 / 6 of fourth ones."""

AGREEING = 2.0
"""Standard errors of the speed by a cubic at least, in the direction of that by a parabola."""

Speed: TypeAlias = tuple[float, float]
"""A speed of the motor and its standard error [rad/s]."""

BY_CHANCE = 1.5
"""Ratio of what a parabola leaves of rows to their noise, up to which that is chance."""


def initial_state(recording: Recording, actuator: Actuator) -> Initial:
    """Return where the recorded manoeuvre starts.

    The user stands where it was recorded, or on the command where its position was not recorded or
    differs by no more than the sensor's noise or one of its counts; the backlash gap is centred. A zero error
    of the sensor may show it beyond an end stop, and it stands at the stop then. Without a
    position the motor's angle stands in for it. Where nothing shows how the shaft moves or stands at first,
    the first rows are not compared (`emaphm.estimation.rows.unknown_start`).
    """
    ratio = actuator.mechanics.gear_ratio
    motion = _FirstMotion.of(recording, actuator)
    speed = _starting_speed(motion) if motion else 0.0
    # At the first instant: a row that is a mean stands for half an interval later.
    position = float(reconstructed(recording, "command_rad")(np.zeros(1))[0])
    moved = speed * _first_time(recording)
    if "position_rad" in recording:
        measured = true_values(recording["position_rad"], "position_rad", actuator)
        first = _starting_position(motion, measured, ratio) if motion and speed else float(measured[0])
        if abs(first - position) > max(SIGNIFICANT * noise_level(measured), visible_count(measured)):
            position = _within_stops(first, actuator)
    angle = position / ratio
    offset = _rotor_offset(recording, actuator) if "angle_rad" in recording else 0.0
    if "angle_rad" in recording and "position_rad" not in recording:
        angle += float(wrap(recording["angle_rad"][0] - moved - offset - angle))
    return Initial(angle, speed, offset)


def _starting_position(motion: "_FirstMotion", measured: Array, ratio: float) -> float:
    """Return the user's position [rad] at the start of a motion, from its `measured` rows (n,).

    By the rows that the speed is estimated from, less the way since the start that their parabola says: one
    row alone is off by noise and half a count, which the position gain makes a speed of.
    """
    rows = motion.chosen
    parabola = np.polynomial.Polynomial(np.polyfit(motion.time[:rows], motion.column[:rows], 2)[::-1])
    if motion.order:
        return float(parabola(0.0))
    way = ratio * parabola.integ()(motion.time[:rows])
    return float(np.mean(measured[:rows] - way))


def _within_stops(position: float, actuator: Actuator) -> float:
    """Return the end stop for a `position` [rad] beyond it by what a zero error of its sensor explains."""
    if actuator.mechanics.end_stops is None:
        return position
    inside = float(np.clip(position, *actuator.mechanics.end_stops))
    usual = usual_deviation(actuator, "position_offset")
    return inside if abs(inside - position) <= SIGNIFICANT * usual else position


def _first_time(recording: Recording) -> float:
    """Return the time that the first row stands for, after the start [s]: a mean's is half an interval."""
    return recording.interval_s / 2 if recording.sampling == "mean" else 0.0


def _rotor_offset(recording: Recording, actuator: Actuator) -> float:
    """Return the motor's angle less the user's [rad], 0 where backlash, noise or lag explain the distance."""
    ratio = actuator.mechanics.gear_ratio
    motor = np.unwrap(recording["angle_rad"])
    # The gap lets the motor be half its width ahead of the user, or behind.
    tolerance = actuator.mechanics.backlash * (1 + actuator.faults.backlash) / 2
    tolerance += SIGNIFICANT * noise_level(motor)
    if "position_rad" in recording:
        user = true_values(recording["position_rad"], "position_rad", actuator) / ratio
        tolerance += SIGNIFICANT * noise_level(user)
    else:
        user = recording["command_rad"] / ratio
        tolerance += float(np.ptp(motor - user)) / 4
    distances = motor - user
    distance = float(wrap(distances[0] + np.median(wrap(distances - distances[0]))))
    return distance if abs(distance) > tolerance else 0.0


def shows_start(recording: Recording, actuator: Actuator) -> bool:
    """Return whether `recording` shows where its motion begins and how fast; a speed alone shows no lag."""
    if not ("position_rad" in recording or ("angle_rad" in recording and "speed_rad_s" in recording)):
        return False
    usual = rms(np.diff(recording["command_rad"])) / recording.interval_s
    motion = _FirstMotion.of(recording, actuator)
    if motion is None:
        return False
    _, error = motion.speed(motion.chosen, 2)
    return error <= KNOWN * usual / actuator.mechanics.gear_ratio


def _starting_speed(motion: "_FirstMotion") -> float:
    """Return the motor's speed [rad/s] at the start, 0 where that is not significant.

    Nor by a polynomial of one degree more, nor in the first rows where these are exact: polynomials through a
    shaft that sticks for a while and then moves have a speed at the start that the shaft has not.
    """
    (speed, error), (other, its_error) = motion.speed(motion.chosen, 2), motion.speed(motion.chosen, 3)
    first, first_error = motion.at_once
    agrees = speed * other > 0 and abs(other) > AGREEING * its_error
    at_once = abs(first - speed) <= max(SIGNIFICANT * first_error, abs(speed) / 2)
    return speed if abs(speed) > SIGNIFICANT * error and agrees and at_once else 0.0


@dataclass(frozen=True, eq=False)
class _FirstMotion:
    """The channel that shows how the motor moves at first: its speed by polynomials through the first rows.

    `column` (n,) at `time` (n,) [s] from the start is the motor's speed where its `order` is 0, the user's
    position where it is 1: the speed [rad/s] is then `scale` times its slope. `noise` and `count` are those
    of a row.
    """

    time: Array
    column: Array
    order: int
    scale: float
    noise: float
    count: float

    @classmethod
    def of(cls, recording: Recording, actuator: Actuator) -> Self | None:
        """Return that of a recorded speed, else of a position; None without both."""
        if "speed_rad_s" in recording and not actuator.sensors.speed_rad_s.unsigned:
            name, order, scale = "speed_rad_s", 0, 1.0
        elif "position_rad" in recording:
            name, order, scale = "position_rad", 1, 1 / actuator.mechanics.gear_ratio
        else:
            return None
        column = true_values(recording[name], name, actuator)
        count = visible_count(column)
        noise = max(noise_level(np.diff(column, 2)) / STEEPER, count / ROUNDING)
        time = recording["time_s"] - recording["time_s"][0] + _first_time(recording)
        return cls(time, column, order, scale, noise, count)

    @property
    def chosen(self) -> int:
        """The most of the first rows of which a parabola leaves no more than noise.

        A coarse converter shows a speed over many rows only, in which the acceleration must not change.
        """
        chosen = FIRST_ROWS[0]
        for rows in FIRST_ROWS[1:]:
            if rows > self.column.size or self._left(rows, 2) > BY_CHANCE * self.noise:
                break
            chosen = rows
        return chosen

    def speed(self, rows: int, degree: int) -> Speed:
        """Return the speed at the start by a polynomial of a `degree` through the first `rows`."""
        coefficients, covariance = np.polyfit(self.time[:rows], self.column[:rows], degree, cov="unscaled")
        error = max(self._left(rows, degree), self.noise) * float(
            covariance[-1 - self.order, -1 - self.order] ** 0.5
        )
        return self.scale * float(coefficients[-1 - self.order]), self.scale * error

    @property
    def at_once(self) -> Speed:
        """The speed by a few rows alone."""
        few = FIRST_ROWS[0] if self.count else AT_ONCE
        slope, covariance = np.polyfit(self.time[:few], self.column[:few], self.order, cov="unscaled")
        return self.scale * float(slope[0]), self.scale * self.noise * float(covariance[0, 0] ** 0.5)

    def _left(self, rows: int, degree: int) -> float:
        time, column = self.time[:rows], self.column[:rows]
        return rms(column - np.polyval(np.polyfit(time, column, degree), time))
