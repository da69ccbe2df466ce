"""Collinear parameters of a calibration, and the channels or manoeuvres that would separate them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from emaphm.actuator import Actuator, Chirp, Command, Ramp, Sine
from emaphm.actuator.commands import rest_position
from emaphm.actuator.quantity import USER_ANGLE, unit_for
from emaphm.arrays import Array
from emaphm.calibration.unit_fit import UnitFit
from emaphm.estimation.compared_channels import comparable_channels
from emaphm.estimation.driving_signals import DrivingSignals
from emaphm.estimation.finite_differences import replicated_jacobians
from emaphm.estimation.joint.objective import JointObjective
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import DEFAULT_SCATTER
from emaphm.estimation.signal_size import signal_size
from emaphm.estimation.space.nuisances import BASELINE, KNOWN_BY
from emaphm.estimation.space.parameter_variation import sizes
from emaphm.estimation.uncertainty.collinearity import collinear_coordinates, listed, resolving_channels
from emaphm.estimation.uncertainty.further_channels import (
    further_channels_information,
    signal_information,
)
from emaphm.estimation.uncertainty.local_covariance import JACOBIAN_STEP, REPLICATES
from emaphm.random_streams import stream
from emaphm.simulation import Initial, Inputs, Plant, observe_batch

MATTERS = 0.02
"""Standard error below which a parameter is known well enough, collinear or not: relative to its value, or
for a parameter of either sign relative to its size (`sizes`)."""

LONGEST_S = 2.0
"""Longest manoeuvre that is tried [s]."""

WORTH_SAYING = 0.01
"""Least centre position of a manoeuvre that is named, relative to the size of the manoeuvre."""


@dataclass(frozen=True)
class CollinearParameters:
    """Set of collinear `members`: parameters, and unknowns of each recording, with similar effects.

    `channels` and `manoeuvres` would separate the members if they were also recorded.
    """

    members: tuple[str, ...]
    channels: tuple[str, ...]
    manoeuvres: tuple[str, ...]

    def __str__(self) -> str:
        """Return a sentence on the members, and on how to separate them."""
        text = (
            f"{listed(self.members, 'and')} act alike in these recordings: their combined effect is known, "
            "the effect of each is not."
        )
        if self.channels:
            return f"{text} A recording that includes {listed(self.channels, 'or')} would separate them."
        if self.manoeuvres:
            return f"{text} A further recording of {listed(self.manoeuvres, 'or')} would separate them."
        return f"{text} Fix one of them at a known value."


def collinear_parameters(fit: UnitFit, calibrated: Actuator, seed: int) -> tuple[CollinearParameters, ...]:
    """Return the sets of parameters of which only a combination is known.

    Sets without a shared parameter, and sets whose parameters are known well nevertheless, are left out.
    """
    joint, covariance = fit.joint, fit.uncertainty.covariance
    # Errors are relative to the estimates, not to the initial description.
    scale = np.diag(joint.unit.axes) / sizes(calibrated, fit.fitted)
    names, errors = _coordinate_names(fit), scale * np.sqrt(np.diag(covariance))[: joint.shared]
    chosen: dict[tuple[str, ...], list[int]] = {}
    for members in collinear_coordinates(covariance):
        shared = members[members < joint.shared]
        called = tuple(dict.fromkeys(names[i] for i in members))
        if shared.size and len(called) > 1 and np.any(errors[shared] > MATTERS):
            chosen[called] = shared.tolist()
    if not chosen:
        return ()
    channels = _channel_information(fit, seed)
    manoeuvres = _manoeuvre_information(fit, seed)
    return tuple(
        CollinearParameters(
            called,
            resolving_channels(covariance, shared, channels),
            resolving_channels(covariance, shared, manoeuvres),
        )
        for called, shared in chosen.items()
    )


def _coordinate_names(fit: UnitFit) -> list[str]:
    """Return the name of each coordinate (d,); equal nuisances of several recordings have the same name."""
    names = list(fit.fitted)
    for term in fit.joint.terms:
        nuisances = term.objective.space.nuisances
        for column in nuisances.meaning.T[: term.own]:
            quantity = nuisances.quantities[int(np.argmax(np.abs(column)))]
            names.append(quantity.removeprefix(BASELINE))
    return names


def _channel_information(fit: UnitFit, seed: int) -> dict[str, Array]:
    """Return the information (d, d) of each channel that a recording lacks, summed over the recordings."""
    joint = fit.joint
    total: dict[str, Array] = {}

    def add(name: str, r: int, information: Array) -> None:
        by_recording = [np.zeros((index.size, index.size)) for index in joint.indices]
        by_recording[r] = information
        total[name] = total.get(name, 0.0) + joint.summed_matrices(by_recording)

    for r, term in enumerate(joint.terms):
        objective, local = term.objective, joint.local(r, fit.point)
        for i, name in enumerate(objective.space.nuisances.names):
            if name in KNOWN_BY:
                add(KNOWN_BY[name], r, np.diag(np.eye(local.size)[i]) / DEFAULT_SCATTER**2)
        problem = objective.problem
        comparable = comparable_channels(problem.actuator)
        missing = tuple(name for name in comparable if name not in problem.measured)
        if not missing:
            continue
        channels = (*missing, *problem.channels)
        extended = problem.observing(channels)

        def signals(points: Array, objective: Any = objective, extended: Any = extended) -> Array:
            predicted = extended.predict(objective.space.faults(points), objective.lumped_parameters(points))
            return np.asarray(predicted.reshape(len(points), -1))

        rng = stream(seed, "Jacobians of further channels", r)
        jacobians = replicated_jacobians(signals, local, objective.space, JACOBIAN_STEP, REPLICATES, rng)
        level = np.split(signals(local[np.newaxis])[0], len(channels))
        parts = np.split(jacobians, len(channels), axis=2)
        further = further_channels_information(
            dict(zip(channels, level, strict=True)),
            dict(zip(channels, parts, strict=True)),
            problem.channels,
        )
        for name, information in further.items():
            add(name, r, information)
    return total


def _manoeuvre_information(fit: UnitFit, seed: int) -> dict[str, Array]:
    """Return, for each manoeuvre, the information (d, d) of a further recording on the shared parameters.

    The priors of the own unknowns of that recording are those of the first recording.
    """
    joint, term = fit.joint, fit.joint.terms[0]
    problem, space = term.objective.problem, term.objective.space
    channels = tuple(dict.fromkeys(n for other in joint.terms for n in other.objective.problem.channels))
    point, by_manoeuvre = joint.local(0, fit.point), {}
    for name, driving in _manoeuvres(joint).items():
        inputs = driving.inputs(problem.model.step_for(problem.actuator))
        start = Initial(rest_position(driving.command) / problem.actuator.mechanics.gear_ratio)

        def signals(points: Array, inputs: Inputs = inputs, start: Initial = start) -> Array:
            plant = Plant.of(problem.actuator, space.faults(points), term.objective.lumped_parameters(points))
            return observe_batch(
                problem.model, plant, inputs, start, channels=channels, workers=problem.workers
            ).reshape(len(points), -1)

        rng = stream(seed, "Jacobians of further manoeuvres", name)
        jacobians = replicated_jacobians(signals, point, space, JACOBIAN_STEP, REPLICATES, rng)
        level = np.split(signals(point[np.newaxis])[0], len(channels))
        parts = np.split(jacobians, len(channels), axis=2)
        by_channel = [
            signal_information(part, signal_size(*named))
            for part, named in zip(parts, zip(channels, level, strict=True), strict=True)
        ]
        total = np.sum(by_channel, axis=0)
        own, added = term.own, np.zeros_like(fit.uncertainty.covariance)
        priors = space.prior_deviations[:own]
        known = np.linalg.inv(total[:own, :own] + np.diag(1 / priors**2))
        cross = total[own:, :own]
        added[: joint.shared, : joint.shared] = total[own:, own:] - cross @ known @ cross.T
        by_manoeuvre[name] = added
    return by_manoeuvre


def _manoeuvres(joint: JointObjective) -> dict[str, DrivingSignals]:
    """Return manoeuvres of the size of the recorded ones, by their description in words."""
    problems = [term.objective.problem for term in joint.terms]
    amplitude, about = max((_room(problem) for problem in problems), key=lambda room: room[0])
    duration = min(max(problem.duration_s for problem in problems), LONGEST_S)
    interval = min(problem.inputs.interval for problem in problems)
    unit = unit_for(USER_ANGLE, problems[0].actuator.coordinates)
    size, reached = f"{amplitude:.3g} {unit}", f"to {amplitude:.3g} {unit}"
    if abs(about) > WORTH_SAYING * amplitude:
        size, reached = (
            f"{size} about {about:.3g} {unit}",
            f"from {about:.3g} to {about + amplitude:.3g} {unit}",
        )
    commands: dict[str, Command] = {
        f"a slow sine of {size} at {1 / duration:.3g} Hz": Sine(amplitude, 1 / duration, about),
        f"a ramp {reached} in {duration:.3g} s": Ramp(amplitude / duration, about=about),
        f"a chirp of {size} up to {20 / duration:.3g} Hz": Chirp(
            amplitude, stop_hz=20 / duration, duration=duration, about=about
        ),
    }
    sampling = problems[0].inputs.sampling
    return {
        name: DrivingSignals(command, 0.0, round(duration / interval), interval, sampling)
        for name, command in commands.items()
    }


def _room(problem: Problem) -> tuple[float, float]:
    """Return the amplitude of a manoeuvre and its centre [rad at the user], from the recorded command.

    The centre is the start position of the recording. If an end stop is too near for that, it is the middle
    of the recorded range.
    """
    mechanics, command = problem.actuator.mechanics, problem.inputs.command
    lowest, highest = float(np.min(command)), float(np.max(command))
    first = problem.start.angle * mechanics.gear_ratio
    size = max(highest - first, first - lowest)
    if mechanics.encloses(first - size, first + size):
        return size, first
    return (highest - lowest) / 2, (lowest + highest) / 2
