"""Parameters that act alike in all recordings, and what would separate them: a channel or a manoeuvre."""

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
for one of either sign to what it adds to (`sizes`)."""

LONGEST_S = 2.0
"""Longest manoeuvre that is tried [s]."""

WORTH_SAYING = 0.01
"""Distance from 0 of the position that a manoeuvre moves about, of its size, from which on it is said."""


@dataclass(frozen=True)
class CollinearParameters:
    """Names of `members` that act alike in the recordings: of parameters, and of each recording's unknowns.

    `channels` and `manoeuvres` would separate them if recorded too.
    """

    members: tuple[str, ...]
    channels: tuple[str, ...]
    manoeuvres: tuple[str, ...]

    def __str__(self) -> str:
        """Return a sentence, and what would separate the members."""
        text = (
            f"{listed(self.members, 'and')} act alike in these recordings: their combined effect is known, "
            "each alone is not."
        )
        if self.channels:
            return f"{text} Recording {listed(self.channels, 'or')} too would separate them."
        if self.manoeuvres:
            return f"{text} A further recording of {listed(self.manoeuvres, 'or')} would separate them."
        return f"{text} Hold one of them at a value that is known."


def collinear_parameters(fit: UnitFit, calibrated: Actuator, seed: int) -> tuple[CollinearParameters, ...]:
    """Return the sets of parameters of which only a combination is known.

    Sets without a shared parameter are left out, and those whose parameters are known well all the same.
    """
    joint, covariance = fit.joint, fit.uncertainty.covariance
    # Relative to what was found, not to the description that was started from.
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
    """Return what each coordinate stands for; those of several recordings under one name."""
    names = list(fit.fitted)
    for term in fit.joint.terms:
        nuisances = term.objective.space.nuisances
        for column in nuisances.meaning.T[: term.own]:
            quantity = nuisances.quantities[int(np.argmax(np.abs(column)))]
            names.append(quantity.removeprefix(BASELINE))
    return names


def _channel_information(fit: UnitFit, seed: int) -> dict[str, Array]:
    """Return the information (d, d) that each channel would add that some recording lacks."""
    joint = fit.joint
    total: dict[str, Array] = {}

    def add(name: str, r: int, information: Array) -> None:
        empty = [np.zeros((index.size, index.size)) for index in joint.indices]
        empty[r] = information
        total[name] = total.get(name, 0.0) + joint.summed_matrices(empty)

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
        other = problem.observing(channels)

        def signals(points: Array, objective: Any = objective, other: Any = other) -> Array:
            predicted = other.predict(objective.space.faults(points), objective.lumped_parameters(points))
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
    """Return the information (d, d) on the shared parameters of a further recording, by its manoeuvre.

    Of its own unknowns as little is known as of those of the first recording.
    """
    joint, term = fit.joint, fit.joint.terms[0]
    problem, space = term.objective.problem, term.objective.space
    channels = tuple(dict.fromkeys(n for one in joint.terms for n in one.objective.problem.channels))
    point, found = joint.local(0, fit.point), {}
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
            signal_information(part, signal_size(*one))
            for part, one in zip(parts, zip(channels, level, strict=True), strict=True)
        ]
        total = np.sum(by_channel, axis=0)
        own, added = term.own, np.zeros_like(fit.uncertainty.covariance)
        priors = space.prior_deviations[:own]
        known = np.linalg.inv(total[:own, :own] + np.diag(1 / priors**2))
        cross = total[own:, :own]
        added[: joint.shared, : joint.shared] = total[own:, own:] - cross @ known @ cross.T
        found[name] = added
    return found


def _manoeuvres(joint: JointObjective) -> dict[str, DrivingSignals]:
    """Return manoeuvres of the size of those recorded, by what they are called."""
    problems = [term.objective.problem for term in joint.terms]
    amplitude, about = max((_room(one) for one in problems), key=lambda room: room[0])
    duration = min(max(one.duration_s for one in problems), LONGEST_S)
    interval = min(one.inputs.interval for one in problems)
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
    """Return how far a manoeuvre may go [rad at the user], and about which position: as the recorded one.

    That is from where it started or, where an end stop is too near for as much to the other side, in the
    middle of what it covered.
    """
    mechanics, command = problem.actuator.mechanics, problem.inputs.command
    lowest, highest = float(np.min(command)), float(np.max(command))
    first = problem.start.angle * mechanics.gear_ratio
    size = max(highest - first, first - lowest)
    if mechanics.encloses(first - size, first + size):
        return size, first
    return (highest - lowest) / 2, (lowest + highest) / 2
