"""Checks of residuals against noise, switching and the known error of the model."""

from collections.abc import Iterator, Mapping

import numpy as np

from emaphm.arrays import Array, rms
from emaphm.diagnosis.explanation.settings import EXPLANATION, RESIDUAL_LIMITS
from emaphm.estimation.discrepancy import resolves_switching
from emaphm.estimation.search_result import EXPECTED_RESIDUAL, SearchResult
from emaphm.estimation.sensors.sensor_model import described_noise
from emaphm.estimation.signal_size import signal_size
from emaphm.estimation.uncertainty.model_error import HealthyComparison
from emaphm.recording.noise import robust_noise_level, rounding_step


def residual_within_limits(recorded: Array, residual: Array, noise: float, *, corrected: bool) -> bool:
    """Return whether `residual` (samples,) of the `recorded` current is within `RESIDUAL_LIMITS`.

    `noise` is the rms of the white noise on the recording.
    """
    allowed = RESIDUAL_LIMITS[corrected]
    variance = (allowed.noise * noise) ** 2 + allowed.model**2 * float(np.mean(recorded**2))
    return bool(np.mean(residual**2) <= variance)


def corrected_by_switching(result: SearchResult) -> bool:
    """Return whether the reference model, with its switching, has corrected the estimate."""
    return bool(result.correction.any()) and resolves_switching(result.objective.problem)


def unlike_healthy(name: str, healthy: Mapping[str, HealthyComparison]) -> Iterator[str]:
    """Yield a sentence if the residual of a channel is worse than in healthy recordings."""
    if not healthy[name].as_healthy:
        yield f"{name}: the residual is {healthy[name]}".rstrip(".")


def primary_residual(result: SearchResult) -> Iterator[str]:
    """Yield a sentence if the residual of the primary channel exceeds its limits."""
    problem = result.objective.problem
    corrected = corrected_by_switching(result)
    residual = result.compared_residual
    recorded, noise = problem.compared(problem.primary, problem.recorded), problem.noise
    share = problem.compared_share(problem.primary)
    switching = result.switching_variance / share
    expected = robust_noise_level(recorded, 2) ** 2 + rounding_step(recorded) ** 2 / 12 + switching
    if described_noise(problem.primary, problem.actuator) is None:
        # Spikes increase the measured variance, but do not count as noise.
        noise = min(noise, EXPLANATION.spikes * expected**0.5)
    noise = (noise**2 + result.slow_variance) ** 0.5
    largest = share * EXPECTED_RESIDUAL**2 * expected
    exceeds = not result.residual_is_expected and result.residual_variance > largest
    if residual_within_limits(recorded, residual, noise, corrected=corrected) and not (corrected and exceeds):
        return
    yield (
        f"{problem.primary}: the residual of {percent(rms(residual), rms(recorded))} is more than noise, "
        "switching and the model's known error account for"
    )


def channel_residuals(
    result: SearchResult, healthy: Mapping[str, HealthyComparison], *, moves: bool
) -> Iterator[str]:
    """Yield a sentence on each channel that the model does not resemble, or whose residual is too large."""
    problem = result.objective.problem
    switching = result.switching_variances
    model = EXPLANATION.channel_model if switching else EXPLANATION.uncorrected_model
    for name, rows in result.residual_by_channel.items():
        variance = switching.get(name, 0.0) / problem.compared_share(name)
        residual, recorded = problem.compared(name, rows), problem.compared(name, problem.measured[name])
        square, size = float(np.mean(residual**2)), signal_size(name, recorded) ** 2
        known = variance + rounding_step(recorded) ** 2 / 12 + (_described_noise(name, result)) ** 2
        noise = max(robust_noise_level(recorded, 2) ** 2, known)
        exceeds = square > EXPLANATION.channel_noise**2 * (noise + variance) + model**2 * size
        share = percent(square**0.5, size**0.5)
        resembled = square <= EXPLANATION.unresembled * size + known or is_drowned(name, recorded, residual)
        if moves and not resembled:
            yield f"{name}: the model does not resemble it (the residual is {share})"
        elif name == problem.primary:
            continue
        elif name in healthy:
            if exceeds or not switching:
                yield from unlike_healthy(name, healthy)
        elif exceeds:
            yield (
                f"{name}: the residual of {share} is more than noise, rounding and "
                "switching account for; its sensor, unit or sign may be wrong"
            )


def is_drowned(name: str, recorded: Array, residual: Array) -> bool:
    """Return whether a channel is noise that contains the modelled signal.

    For y = m + n, with m modelled and n independent noise, y² - n² is m², with a random error of 2 |m n| /
    √rows. For a signal unrelated to the model it is -m². An example is the current along the flux, which is
    controlled to 0.
    """
    modelled, residual_rms = signal_size(name, recorded - residual), rms(residual)
    tolerance = 2 * EXPLANATION.drowned_errors * modelled * residual_rms / recorded.size**0.5
    difference = signal_size(name, recorded) ** 2 - residual_rms**2
    return bool(difference >= (1 - EXPLANATION.unresembled) * modelled**2 - tolerance)


def _described_noise(name: str, result: SearchResult) -> float:
    """Return the described rms noise of a channel, 0 without one."""
    return described_noise(name, result.objective.problem.actuator) or 0.0


def percent(part: float, whole: float) -> str:
    """Return `part` in percent of the `whole`; in its own unit if the whole is 0."""
    return f"{100 * part / whole:.3g} %" if whole > 0 else f"{part:.3g}"
