"""The learned error of a calibrated model on a recording: which residual is no worse than healthy.

The description's `[model_error]` says how the error varies (`actuator.unit.model_error.ChannelError`); here
it is evaluated for the manoeuvre of a recording. Without that section, nothing here changes a diagnosis.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.faults import HEALTHY
from emaphm.actuator.unit.model_error import ChannelError
from emaphm.arrays import Array
from emaphm.estimation.problem import Problem
from emaphm.estimation.sensors.sensor_model import described_noise
from emaphm.estimation.uncertainty.correlation import white_noise
from emaphm.quantiles import normal_quantile, student_t_distribution, student_t_quantile
from emaphm.recording.noise import noise_level


@dataclass(frozen=True)
class HealthySettings:
    """What residual of a channel counts as no worse than healthy.

    Its ratio to the expected rms has the bound that the next healthy recording stays below with
    `probability`, if the logarithms of the ratios are normal; at least `least`, which switching and noise
    alone reach, and at most `most`: few recordings that scatter much would else call anything healthy. `make
    study` (limits) counts what is explained, and false alarms.

    White noise of a channel up to `most_noise` times that of the healthy recordings is expected: faults
    change the ripple, but noise that only this recording has explains nothing.
    """

    most_noise: float = 2.0
    probability: float = 0.95
    least: float = 1.1
    most: float = 3.0


HEALTHY_RESIDUAL = HealthySettings()


@dataclass(frozen=True)
class HealthyComparison:
    """The residual of one channel compared with that of healthy recordings, rms in the unit of the channel.

    `ratio` is `residual` over `expected`, and `allowed` the largest one that is no worse than healthy: what
    the next healthy recording stays below with probability `confidence` if ratios are log-normal, and with
    probability `rank_confidence` whatever their distribution, as it stays below the largest of `recordings`.
    """

    residual: float
    expected: float
    allowed: float
    confidence: float
    recordings: int

    @property
    def ratio(self) -> float:
        """The residual relative to the expected one."""
        return self.residual / self.expected if self.expected > 0 else float("inf")

    @property
    def as_healthy(self) -> bool:
        """Whether the residual is no worse than that of healthy recordings."""
        return self.ratio <= self.allowed

    def to_dict(self) -> dict[str, float | int | bool]:
        """Return what a diagnosis prints of the channel as JSON."""
        return {
            "residual": self.residual,
            "expected": self.expected,
            "ratio": self.ratio,
            "allowed": self.allowed,
            "as_healthy": self.as_healthy,
            "confidence": self.confidence,
            "recordings": self.recordings,
        }

    def __str__(self) -> str:
        """Return one sentence: the residual, and up to where a healthy recording's may be."""
        return (
            f"{self.ratio:.2f} times that of {self.recordings} healthy recordings left out of the "
            f"calibration; up to {self.allowed:.2f} times is no worse than healthy (the next healthy one "
            f"stays below with {100 * self.confidence:.0f} % if ratios are log-normal; {self.recordings} "
            f"recordings alone show {100 * self.rank_confidence:.0f} %)."
        )

    @property
    def rank_confidence(self) -> float:
        """The confidence that so few recordings allow without any assumption on the distribution."""
        return self.recordings / (self.recordings + 1)


def variance_terms(problem: Problem) -> Array:
    """Return what the variance of the error is linear in, (4, samples): 1, ω², τ², α² of each row.

    Speed and acceleration of the motor are those of the healthy model [rad/s], [rad/s²]: smooth, and the same
    whatever was recorded. The load is the recorded one [N·m], 0 where it was not.
    """
    speed = problem.signals(HEALTHY.vector)["speed_rad_s"]
    load = problem.inputs.rows(problem.inputs.load)
    acceleration = np.gradient(speed, problem.inputs.interval)
    return np.stack([np.ones_like(speed), speed**2, load**2, acceleration**2])


def row_errors(problem: Problem) -> dict[str, Array]:
    """Return the rms error of the model in each row, (samples,) by channel, where one was learned."""
    learned = {name: problem.actuator.model_error.of(name) for name in problem.measured}
    known = {name: one for name, one in learned.items() if one is not None}
    if not known:
        return {}
    terms = variance_terms(problem)
    return {name: np.sqrt(_coefficients(one) @ terms) for name, one in known.items()}


def _coefficients(error: ChannelError) -> Array:
    return np.array([error.floor, error.speed, error.load, error.acceleration]) ** 2


def channel_noise(problem: Problem, channel: str, residual: Array) -> float:
    """Return the rms of the white noise on a channel, in its unit.

    As its sensor is described; else from the measured channel, or as the least dense part of the spectrum of
    its `residual` (samples,), whichever shows less: a fast oscillation of the channel passes for noise.
    """
    described = described_noise(channel, problem.actuator)
    if described is not None:
        return described
    return min(noise_level(problem.measured[channel]), white_noise(residual))


def expected_residual(problem: Problem, residuals: Mapping[str, Array]) -> dict[str, float]:
    """Return the rms residual that a healthy recording would leave of each compared channel, in its unit.

    Noise and learned model error add by squares. Channels without a learned error are left out.
    `residuals` (samples,) by channel tell noise from oscillation.
    """
    found = {}
    for name in problem.channels:
        if name in problem.model_error:
            noise = healthy_noise(problem, name, channel_noise(problem, name, residuals[name]))
            variance = noise**2 + error_variance(problem, name)
            found[name] = float(variance**0.5)
    return found


def healthy_noise(problem: Problem, channel: str, noise: float) -> float:
    """Return the share of a channel's white `noise` (rms) that a healthy recording may have, in its unit."""
    error = problem.actuator.model_error.of(channel)
    known = None if error is None else error.noise
    if known is None or described_noise(channel, problem.actuator) is not None:
        return noise
    return min(noise, HEALTHY_RESIDUAL.most_noise * known)


def error_variance(problem: Problem, channel: str) -> float:
    """Return the mean square of the learned error of a channel over the recording, 0 without one."""
    rows = problem.model_error.get(channel)
    return 0.0 if rows is None else float(np.mean(rows**2))


def compared_with_healthy(
    problem: Problem,
    residuals: Mapping[str, Array],
    *,
    least_share: float,
    switching: Mapping[str, float],
) -> dict[str, HealthyComparison]:
    """Return each channel's residual (samples,), in the rows that are compared, next to healthy recordings'.

    Of the channels where that was learned.

    Two things that healthy recordings do not show are expected too, added by squares. `switching` is its
    variance at the estimate, by channel: what it exceeds the learned error by, since faults change the
    ripple. Of the primary channel a residual of `least_share` of its rms is left where the estimate is right.
    """
    found = {}
    residuals = {name: problem.compared(name, rows) for name, rows in residuals.items()}
    for name, healthy in expected_residual(problem, residuals).items():
        share = least_share if name == problem.primary else 0.0
        left = share**2 * float(np.mean(problem.measured[name] ** 2))
        ripple = switching.get(name, 0.0) / problem.compared_share(name)
        ripple = max(0.0, ripple - error_variance(problem, name))
        expected = float((healthy**2 + left + ripple) ** 0.5)
        error = problem.actuator.model_error.of(name)
        assert error is not None  # noqa: S101 - what is expected has been learned
        size = float(np.sqrt(np.mean(residuals[name] ** 2)))
        bound = largest_healthy_ratio(error)
        found[name] = HealthyComparison(size, expected, bound, _confidence(error, bound), error.recordings)
    return found


def largest_healthy_ratio(error: ChannelError) -> float:
    """Return the largest residual of a channel, relative to the expected one, that is no worse than healthy.

    The prediction limit of a normal sample of n logarithms about a known mean of 0,
    exp(t s √(1 + 1/n)) with Student's t of n - 1 degrees of freedom (Hahn and Meeker 1991, ch. 4).
    """
    n, settings = error.recordings, HEALTHY_RESIDUAL
    reach = student_t_quantile(n - 1, settings.probability) * error.scatter * (1 + 1 / n) ** 0.5
    return float(np.clip(np.exp(min(reach, 700.0)), settings.least, settings.most))


def _confidence(error: ChannelError, bound: float) -> float:
    """Return the probability that the next healthy recording stays below a `bound` of its ratio."""
    n = error.recordings
    scatter = error.scatter * (1 + 1 / n) ** 0.5
    return 1.0 if scatter == 0 else float(student_t_distribution(n - 1, np.log(bound) / scatter))


def error_inflation(recordings: int) -> float:
    """Return the factor on a learned standard deviation, so that normal intervals hold for few `recordings`.

    Student's t, with as many degrees of freedom as there were recordings: rows of one are no independent
    evidence on the next.
    """
    return student_t_quantile(recordings, 0.975) / float(normal_quantile(0.975))


def apparent_fault_covariance(actuator: Actuator, coordinates: Sequence[str]) -> Array | float:
    """Return what the apparent faults of healthy recordings add to the covariance (d, d); 0.0 if unknown."""
    apparent = actuator.model_error.faults
    if apparent is None:
        return 0.0
    deviations = np.array([apparent.of(name) for name in coordinates]) * error_inflation(apparent.recordings)
    return np.diag(deviations**2)


def error_scores(problem: Problem, jacobian: Array) -> Array | float:
    """Return the covariance (d, d) of `jacobian` (d, channel rows) times the learned error; 0.0 without one.

    Σ_c (T_c / Δt) J_c diag(w_c² σ_c²) J_cᵀ, an upper bound over all correlations of integral time T_c: a fit
    absorbs the part of the error that looks like a parameter, so that its residual does not show it.
    """
    if not problem.model_error:
        return 0.0
    total = np.zeros((len(jacobian),) * 2)
    parts = np.split(jacobian, len(problem.channels), axis=1)
    for name, part, weight in zip(problem.channels, parts, problem.weights, strict=True):
        error = problem.actuator.model_error.of(name)
        if error is None or name not in problem.model_error:
            continue
        rows = max(1.0, error.correlation_time / problem.inputs.interval)
        scaled = part * (weight * error_inflation(error.recordings) * problem.model_error[name])
        total += rows * scaled @ scaled.T
    return total
