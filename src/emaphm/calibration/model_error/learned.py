"""Error of a calibrated model, learned from healthy recordings that were left out of the fit.

Residuals of the training would be too small, because a fit absorbs errors that resemble its parameters. Each
recording is therefore left out once, the others are fitted, and only the own unknowns of the recording left
out are estimated. The part of its residual that white noise does not explain is the error of the model.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.actuator.unit.model_error import CHANNELS, NOT_LEARNED, ChannelError, ModelError
from emaphm.arrays import Array
from emaphm.calibration.campaign import CampaignRow
from emaphm.calibration.findings import found_values
from emaphm.calibration.held_out import folds, left_out_residual, own_coordinates, subset
from emaphm.calibration.model_error.apparent_faults import apparent_faults
from emaphm.calibration.unit_fit import FitSettings, UnitFit
from emaphm.estimation.joint.correction import can_be_compared, compared, corrected_estimate
from emaphm.estimation.joint.search import DESCENT
from emaphm.estimation.levenberg_marquardt import descend
from emaphm.estimation.problem import Problem
from emaphm.estimation.uncertainty.correlation import integral_time
from emaphm.estimation.uncertainty.model_error import channel_noise, variance_terms


@dataclass(frozen=True)
class ModelErrorSettings:
    """Settings of learning a model error.

    Recordings are left out one at a time; more than `most_folds` recordings are left out in `most_folds`
    groups. The fit without them starts from the end point of the fit of all recordings, with `corrections` of
    its bias. Up to `most_diagnosed` of them are also diagnosed, which takes a second each. The variance at
    rest is at least the share `least_floor` of the mean variance, because three recordings do not prove that
    a model is exact anywhere. The error is at least the share `least_error` of the residual's variance, which
    is the accuracy with which second differences separate noise from the model's error.
    `tests/calibration/test_model_error.py` measures both on artificial errors.
    """

    most_folds: int = 5
    corrections: int = 2
    most_diagnosed: int = 5
    least_floor: float = 0.1
    least_error: float = 0.01


MODEL_ERROR = ModelErrorSettings()

LEAST_SCATTER = 1e-12
"""Scatter of the logarithms below which recordings differ only by rounding."""


@dataclass(frozen=True, eq=False)
class HeldOutResidual:
    """Residual of one channel of a recording that was left out.

    `residual` (samples,) and white `noise` (rms) are in the channel's unit; `terms` (4, samples) are the
    regressors of the error's variance; `interval` is the interval between rows [s].
    """

    residual: Array
    noise: float
    terms: Array
    interval: float

    @property
    def error_variance(self) -> float:
        """Mean square of the residual less the noise variance, at least a small share of the mean square."""
        square = float(np.mean(self.residual**2))
        return max(square - self.noise**2, MODEL_ERROR.least_error * square)


def learned_model_error(
    rows: Sequence[CampaignRow],
    fit: UnitFit,
    described: Actuator,
    calibrated: Actuator,
    settings: FitSettings,
) -> ModelError:
    """Return the error of the model in the recordings `rows` of `fit`; `NOT_LEARNED` for a single recording.

    It contains the error of every channel and, if diagnoses are possible, the apparent faults. The parameters
    of the fit are deviations from the `described` actuator; `calibrated` has these parameters and a baseline.
    """
    if len(rows) < 2:
        return NOT_LEARNED
    shared = _fitted_without(fit, settings)
    by_channel: dict[str, list[HeldOutResidual]] = {}
    for r, values in shared.items():
        problem = fit.joint.terms[r].objective.problem
        for name, held_out in _by_channel(problem, _left_out_residual(fit, r, values, settings)).items():
            by_channel.setdefault(name, []).append(held_out)
    channels = ModelError(
        **{
            name: channel_error(left_out)
            for name, left_out in by_channel.items()
            if name in CHANNELS and len(left_out) > 1 and any(np.any(part.residual) for part in left_out)
        }
    )
    known = calibrated.model_copy(update={"model_error": channels})
    diagnosed = [r for r in shared if not rows[r].free][: MODEL_ERROR.most_diagnosed]
    units = [(rows[r], _unit(fit, described, known, shared[r])) for r in diagnosed]
    faults = apparent_faults(units, settings.max_corrections, settings.seed, settings.workers)
    return channels.model_copy(update={"faults": faults})


def _unit(fit: UnitFit, described: Actuator, calibrated: Actuator, shared: Array) -> Actuator:
    """Return the calibrated actuator with the `shared` coordinates (p,) of another fit."""
    deviations = np.array(
        [shared[fit.fitted.index(name)] if name in fit.fitted else 0.0 for name in fit.free]
    )
    return with_lumped_parameters(calibrated, found_values(replace(fit, deviations=deviations), described))


def _fitted_without(fit: UnitFit, settings: FitSettings) -> dict[int, Array]:
    """Return, by the number of each recording, the shared coordinates (p,) of the fit without it."""
    joint, shared_by_recording = fit.joint, dict[int, Array]()
    count, corrections = len(joint.terms), min(settings.max_corrections, MODEL_ERROR.corrections)
    for left_out in folds(count, MODEL_ERROR.most_folds, settings.seed):
        training, start = subset(joint, fit.point, [r for r in range(count) if r not in left_out])
        if corrections and can_be_compared(training):
            best = corrected_estimate(training, start, corrections, settings.seed).point
        else:
            best = descend(training, start[np.newaxis], training.box, DESCENT).best
        shared_by_recording |= dict.fromkeys(sorted(left_out), best[: training.shared])
    return shared_by_recording


def _left_out_residual(fit: UnitFit, r: int, shared: Array, settings: FitSettings) -> Array:
    """Return the residual (rows,) of recording `r` under `shared` coordinates (p,), with its own estimated.

    If the reference model can run, the residual is that of the reference model, at the own coordinates with
    the smaller residual: those of the joint fit, or those of the best fit of the averaged model.
    """
    corrections = zip(fit.joint.terms, fit.estimate.discrepancies, strict=True)
    corrected = fit.joint.corrected([term.correction + known.mean for term, known in corrections])
    alone, point = subset(fit.joint, fit.point, [r])
    if not (settings.max_corrections and can_be_compared(alone)):
        return left_out_residual(corrected, r, shared)
    owns = [point[alone.shared :], own_coordinates(corrected, r, shared)]
    points = alone.box.project(np.array([np.concatenate([shared, own]) for own in owns]))
    outcomes = compared(alone, points, settings.seed, "left out", r)
    return min(outcomes, key=lambda outcome: outcome.primary_variance).corrected_residuals[0]


def _by_channel(problem: Problem, residual: Array) -> dict[str, HeldOutResidual]:
    """Return the residual of each channel of a recording from the weighted `residual` (rows,)."""
    rows = residual[: len(problem.channels) * problem.samples].reshape(len(problem.channels), -1)
    terms = variance_terms(problem)
    by_channel = {}
    for name, weighted, weight in zip(problem.channels, rows, problem.weights, strict=True):
        noise = channel_noise(problem, name, weighted / weight)
        by_channel[name] = HeldOutResidual(weighted / weight, noise, terms, problem.inputs.interval)
    return by_channel


def channel_error(left_out: Sequence[HeldOutResidual]) -> ChannelError:
    """Return the error of one channel from two or more recordings; all recordings have the same weight.

    The variance is fitted to the squared residuals by least squares without negative coefficients (Lawson and
    Hanson 1974), and scaled to their mean.
    """
    coefficients = _variance_coefficients(left_out)
    expected = [float(np.mean(coefficients @ part.terms)) + part.noise**2 for part in left_out]
    squares = [float(np.mean(part.residual**2)) for part in left_out]
    logs = 0.5 * np.log(np.maximum(squares, np.finfo(float).tiny) / np.array(expected))
    scatter = float(np.sqrt(np.sum(logs**2) / (len(logs) - 1)))
    floor, speed, load, acceleration = np.sqrt(coefficients).tolist()
    return ChannelError(
        floor=floor,
        speed=speed,
        load=load,
        acceleration=acceleration,
        noise=float(np.sqrt(np.mean([part.noise**2 for part in left_out]))),
        correlation_time=_correlation_time(left_out),
        scatter=scatter if scatter > LEAST_SCATTER else 0.0,
        recordings=len(left_out),
    )


def _variance_coefficients(left_out: Sequence[HeldOutResidual]) -> Array:
    """Return the coefficients of the variance's terms, (4,), each at least 0."""
    from scipy.optimize import nnls

    mean = float(np.mean([part.error_variance for part in left_out]))
    sizes = np.maximum(np.mean([part.terms.mean(axis=1) for part in left_out], axis=0), np.finfo(float).tiny)
    design = np.concatenate(
        [(part.terms / sizes[:, np.newaxis]).T / len(part.residual) ** 0.5 for part in left_out]
    )
    target = np.concatenate(
        [(part.residual**2 - part.noise**2) / len(part.residual) ** 0.5 for part in left_out]
    )
    shares, _ = nnls(design, target)
    total = float(np.sum(shares))
    # The mean of each scaled term is 1, so that the shares are shares of the mean variance.
    shares = shares / total if total > 0 else np.array([1.0, 0.0, 0.0, 0.0])
    floor = max(float(shares[0]), MODEL_ERROR.least_floor)
    varying = shares[1:] * ((1 - floor) / max(float(np.sum(shares[1:])), np.finfo(float).tiny))
    return np.asarray(mean * np.concatenate([[floor], varying]) / sizes)


def _correlation_time(left_out: Sequence[HeldOutResidual]) -> float:
    """Return the integral time [s] of the error, without the part of the white noise."""
    interval = min(part.interval for part in left_out)
    total = integral_time([part.residual for part in left_out], [part.interval for part in left_out])
    square = float(np.mean([np.mean(part.residual**2) for part in left_out]))
    noise = float(np.mean([part.noise**2 for part in left_out]))
    error = float(np.mean([part.error_variance for part in left_out]))
    return float(max((total * square - noise * interval) / error, interval))
