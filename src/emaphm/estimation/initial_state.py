"""Where a recorded manoeuvre starts: the motor's angle and speed, and the rotor's electrical zero."""

import math
from typing import TypeAlias

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import rms
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
    speed = _starting_speed(recording, actuator)
    # At the first instant: a row that is a mean stands for half an interval later.
    position = float(reconstructed(recording, "command_rad")(np.zeros(1))[0])
    moved = speed * _first_time(recording)
    if "position_rad" in recording:
        measured = true_values(recording["position_rad"], "position_rad", actuator)
        first = float(measured[0]) - moved * ratio
        if abs(first - position) > max(SIGNIFICANT * noise_level(measured), visible_count(measured)):
            position = _within_stops(first, actuator)
    angle = position / ratio
    offset = _rotor_offset(recording, actuator) if "angle_rad" in recording else 0.0
    if "angle_rad" in recording and "position_rad" not in recording:
        angle += float(wrap(recording["angle_rad"][0] - moved - offset - angle))
    return Initial(angle, speed, offset)


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
    (_, error), *_ = _speeds(recording, actuator)
    return error <= KNOWN * usual / actuator.mechanics.gear_ratio


def _starting_speed(recording: Recording, actuator: Actuator) -> float:
    """Return the motor's speed [rad/s] at the start, 0 where that is not significant.

    Nor by a polynomial of one degree more, nor in the first rows where these are exact: polynomials through a
    shaft that sticks for a while and then moves have a speed at the start that the shaft has not.
    """
    (speed, error), (other, its_error), (first, first_error) = _speeds(recording, actuator)
    agrees = speed * other > 0 and abs(other) > AGREEING * its_error
    at_once = abs(first - speed) <= max(SIGNIFICANT * first_error, abs(speed) / 2)
    return speed if abs(speed) > SIGNIFICANT * error and agrees and at_once else 0.0


def _speeds(recording: Recording, actuator: Actuator) -> tuple[Speed, Speed, Speed]:
    """Return the motor's speed [rad/s] at the start and its standard error, in three ways.

    By a parabola, by a cubic, and by a few rows alone (`AT_ONCE`). Infinite errors where nothing shows it. A
    coarse converter shows a speed over many rows only, in which the acceleration must not change.
    """
    if "speed_rad_s" in recording and not actuator.sensors.speed_rad_s.unsigned:
        name, order, scale = "speed_rad_s", 0, 1.0
    elif "position_rad" in recording:
        name, order, scale = "position_rad", 1, 1 / actuator.mechanics.gear_ratio
    else:
        return (0.0, math.inf), (0.0, math.inf), (0.0, math.inf)
    column = true_values(recording[name], name, actuator)
    count = visible_count(column)
    noise = max(noise_level(np.diff(column, 2)) / STEEPER, count / ROUNDING)
    time = recording["time_s"] - recording["time_s"][0] + _first_time(recording)

    def fitted(rows: int, degree: int) -> tuple[Speed, float]:
        coefficients, covariance = np.polyfit(time[:rows], column[:rows], degree, cov="unscaled")
        left = rms(column[:rows] - np.polyval(coefficients, time[:rows]))
        error = max(left, noise) * float(covariance[-1 - order, -1 - order] ** 0.5)
        return (scale * float(coefficients[-1 - order]), scale * error), left

    chosen = FIRST_ROWS[0]
    for rows in FIRST_ROWS[1:]:
        if rows > column.size or fitted(rows, 2)[1] > BY_CHANCE * noise:
            break
        chosen = rows
    few = FIRST_ROWS[0] if count else AT_ONCE
    slope, covariance = np.polyfit(time[:few], column[:few], order, cov="unscaled")
    at_once = (scale * float(slope[0]), scale * noise * float(covariance[0, 0] ** 0.5))
    return fitted(chosen, 2)[0], fitted(chosen, 3)[0], at_once
