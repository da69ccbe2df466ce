"""When an estimate explains a recording, and if not, why: in every channel, and with plausible nuisances."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.unit.baseline import SIGNED
from emaphm.arrays import Array, rms
from emaphm.diagnosis.explanation.contradicted_rotor_zero import contradicted_zero
from emaphm.diagnosis.explanation.followed_channels import unfollowed
from emaphm.diagnosis.explanation.known_values import contradicted_values
from emaphm.diagnosis.explanation.sensor_scores import contradictions
from emaphm.estimation.compared_channels import comparable_channels
from emaphm.estimation.discrepancy import resolves_switching
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import EXPECTED_RESIDUAL, SearchResult
from emaphm.estimation.sensors.sensor_model import described_noise, error_kind, sensor_error, sensor_of
from emaphm.estimation.signal_size import signal_size
from emaphm.estimation.space.nuisances import BASELINE, has_stated_prior, unit_of, usual_deviation
from emaphm.estimation.space.parameter_variation import variation_unit
from emaphm.estimation.uncertainty.model_error import HealthyComparison
from emaphm.recording.noise import robust_noise_level, rounding_step
from emaphm.recording.schema import PHASES


@dataclass(frozen=True)
class ResidualSettings:
    """The largest residual of the current that is accepted: `noise` and `model` add by squares.

    `noise` is a multiple of the white noise on the recording, `model` a share of the current's rms.
    """

    noise: float
    model: float


KNOWN_INERTIA = 0.01
"""Standard deviation of an inertia, relative, up to which it needs no note."""

RESIDUAL_LIMITS = {False: ResidualSettings(1.5, 0.05), True: ResidualSettings(1.25, 0.02)}
"""Without and with correction by the reference model. On recordings that the reference model made itself,
the corrected residual was up to 1.17 times the noise."""


@dataclass(frozen=True)
class ExplanationSettings:
    """What else an estimate has to fulfil, to explain a recording; `make study` (spoilt) measures it.

    A noise that is measured on the recording counts up to `spikes` times what most of the rows show.

    A channel other than the primary one may have a residual of `channel_model` of its rms
    (`uncorrected_model` where the reference model was not asked), and of `channel_noise` times its noise,
    rounding and switching.
    Beyond rounding and switching, the residual may be no more than `unresembled` of every channel's mean
    square: a noise that is measured on the recording itself would otherwise excuse a model that resembles
    nothing. Where it is more, the model's signal must be found in the recorded one again, to
    `drowned_errors` standard errors.

    A nuisance may be `prior_deviations` standard deviations of its prior off, where the description states
    that prior; a prior that is merely usual, as the load's, says nothing against a larger one. So may a
    parameter with a tolerance or of the unit's calibration.

    Phase currents may add up to `phase_sum` of their rms, and to `channel_noise` times the noise of the sum.
    """

    spikes: float = 1.5
    channel_noise: float = 1.5
    channel_model: float = 0.05
    uncorrected_model: float = 0.15
    unresembled: float = 0.5
    drowned_errors: float = 2.0
    prior_deviations: float = 3.0
    phase_sum: float = 0.05


EXPLANATION = ExplanationSettings()


def reasons_against(
    result: SearchResult,
    jacobians: Array,
    healthy: Mapping[str, HealthyComparison],
    seed: int,
    *,
    moves: bool,
) -> tuple[str, ...]:
    """Return why the estimate of `result` does not explain the recording, a sentence each; none if it does.

    An estimate explains a recording where all of this holds:

    1. The residual of the primary channel (a current) is one of noise, switching and the model's known error:
       r² ≤ (a σ)² + (b y)², with σ its noise and y its rms, a and b from `RESIDUAL_LIMITS`. Where the
       reference model has corrected it, r is also at most `EXPECTED_RESIDUAL` times noise or switching, or
       times the root of the sum of their squares where the noise is that of most rows.
    2. So is that of every other channel that is compared: r² ≤ c² (σ² + q²/12 + s²) + (m y)², with q the step
       that it is rounded to, s² the variance of switching, c and m from `EXPLANATION`. Of a position, y is
       the rms of its distance from where it starts.
       Where a calibration has learned the model's error in a channel, a residual that is no worse than that
       of healthy recordings is enough. Of the primary channel it is asked in place of 1, and of any channel
       where the reference model has not corrected the estimate.
    3. The model resembles every channel: r² ≤ u y² + q²/12 + s², or what is more is noise in which the
       model's signal is found again. Not asked of an actuator at rest.
    4. No nuisance is farther off than its stated prior allows, and no parameter of the unit than its
       tolerance or the standard error of its calibration. The error of a sensor may be: it is reported as a
       fault of that sensor.
    5. The residual shows no sensor that comes late, nor one of another scale or zero, beyond what the faults
       take up (`emaphm.diagnosis.explanation.sensor_scores`).
    6. No recorded load or temperature is contradicted (`emaphm.diagnosis.explanation.known_values`).
    7. Three recorded phase currents of a star add up to zero, within `phase_sum` of their size.
    8. No sensor of the current or the motion shows one value throughout where the model moves.
    9. The residual shows no electrical zero of the rotor but the position's
       (`emaphm.diagnosis.explanation.contradicted_rotor_zero`).
    10. No two sensors have another scale, each by more than `prior_deviations`: faults of sensors are rare,
       and times that are stretched change the scale of everything that moves.
    11. Of a channel whose sensor has another scale, the model explains more of the variation than of noise
        (`emaphm.diagnosis.explanation.followed_channels`).

    The fifth, sixth and ninth are asked where the reference model has corrected the estimate by its
    switching: of other drives a few percent are left of any machine, whose direction may be that of a
    sensor's. So may that of a learned error of the model, with which the fifth and ninth are not asked.

    Parameters
    ----------
    result
        The estimate, and what was minimised.
    jacobians
        Of the channels there, (n, d, channel rows).
    healthy
        The residuals next to those of healthy recordings, by channel, where they were learned.
    seed
        For the descents that some of it takes.
    moves
        Whether the actuator moved.
    """
    primary = result.objective.problem.primary
    found = [
        *(_unlike_healthy(primary, healthy) if primary in healthy else _primary(result)),
        *_channels(result, healthy, moves=moves),
        *_unfollowed(result),
        *_nuisances(result),
        *_unit(result),
        *_scales(result),
        *_phases(result),
        *(_standing(result) if moves else ()),
    ]
    if moves and _by_switching(result):
        found += contradicted_values(result, seed)
        if not healthy:
            found += contradicted_zero(result, jacobians, seed) or contradictions(result, jacobians, seed)
    return tuple(found)


def idle_channels(problem: Problem) -> tuple[str, ...]:
    """Return a note on each recorded channel that is not compared, because it shows one value throughout."""
    return tuple(
        f"{name} is {problem.measured[name][0]:.3g} throughout and is not compared; check its sensor, or "
        "leave the column out"
        for name in comparable_channels(problem.actuator, problem.model)
        if name in problem.measured and name not in problem.channels and np.ptp(problem.measured[name]) == 0
    )


def unseen_inertia(objective: MapObjective) -> tuple[str, ...]:
    """Return a note on an inertia that is taken as described where nothing would show another.

    None where no nuisance is estimated: then all is taken as described.

    From the current alone, an inertia 5 % off left no larger residual, and friction that was off by 0.05 in
    intervals of 0.002, in nine of twelve random fault vectors.
    """
    nuisances, problem = objective.space.nuisances, objective.problem
    prior = usual_deviation(problem.actuator, "inertia")
    known = "inertia" in (*nuisances.chosen, *nuisances.parameters) or prior <= KNOWN_INERTIA
    if known or not nuisances.chosen or len(problem.channels) > 1:
        return ()
    note = (
        f"the inertia is taken as described: from {problem.primary} alone, one that is {100 * prior:.2g} % "
        "off reads as faults, of the friction above all; estimate it too (--nuisance "
        "load,temperature,inertia), record another channel, or say by 'inertia' under [nuisances] how well "
        "it is known"
    )
    return (note,)


def residual_within_limits(recorded: Array, residual: Array, noise: float, *, corrected: bool) -> bool:
    """Return whether `residual` (samples,) of the `recorded` current is within `RESIDUAL_LIMITS`.

    `noise` is the rms of the white noise on the recording.
    """
    allowed = RESIDUAL_LIMITS[corrected]
    variance = (allowed.noise * noise) ** 2 + allowed.model**2 * float(np.mean(recorded**2))
    return bool(np.mean(residual**2) <= variance)


def _by_switching(result: SearchResult) -> bool:
    """Return whether the reference model has corrected what the averaged one lacks."""
    return bool(result.correction.any()) and resolves_switching(result.objective.problem)


def _unlike_healthy(name: str, healthy: Mapping[str, HealthyComparison]) -> Iterator[str]:
    if not healthy[name].as_healthy:
        yield f"{name}: the residual is {healthy[name]}".rstrip(".")


def _primary(result: SearchResult) -> Iterator[str]:
    problem = result.objective.problem
    corrected = _by_switching(result)
    residual = result.compared_residual
    recorded, noise = problem.compared(problem.primary, problem.recorded), problem.noise
    share = problem.compared_share(problem.primary)
    switching = result.switching_variance / share
    usual = robust_noise_level(recorded, 2) ** 2 + rounding_step(recorded) ** 2 / 12 + switching
    if described_noise(problem.primary, problem.actuator) is None:
        # Spikes are no noise, whatever they add to its variance.
        noise = min(noise, EXPLANATION.spikes * usual**0.5)
    noise = (noise**2 + result.slow_variance) ** 0.5
    largest = share * EXPECTED_RESIDUAL**2 * usual
    exceeds = not result.residual_is_expected and result.residual_variance > largest
    if residual_within_limits(recorded, residual, noise, corrected=corrected) and not (corrected and exceeds):
        return
    yield (
        f"{problem.primary}: the residual of {_percent(rms(residual), rms(recorded))} is more than noise, "
        "switching and the model's known error account for"
    )


def _channels(
    result: SearchResult, healthy: Mapping[str, HealthyComparison], *, moves: bool
) -> Iterator[str]:
    problem = result.objective.problem
    switching = result.switching_variances
    model = EXPLANATION.channel_model if switching else EXPLANATION.uncorrected_model
    for name, rows in result.residual_by_channel.items():
        variance = switching.get(name, 0.0) / problem.compared_share(name)
        residual, recorded = problem.compared(name, rows), problem.compared(name, problem.measured[name])
        square, size = float(np.mean(residual**2)), signal_size(name, recorded) ** 2
        known = variance + rounding_step(recorded) ** 2 / 12 + (_described(name, result)) ** 2
        noise = max(robust_noise_level(recorded, 2) ** 2, known)
        exceeds = square > EXPLANATION.channel_noise**2 * (noise + variance) + model**2 * size
        share = _percent(square**0.5, size**0.5)
        resembled = square <= EXPLANATION.unresembled * size + known or is_drowned(name, recorded, residual)
        if moves and not resembled:
            yield f"{name}: the model does not resemble it (the residual is {share})"
        elif name == problem.primary:
            continue
        elif name in healthy:
            if exceeds or not switching:
                yield from _unlike_healthy(name, healthy)
        elif exceeds:
            yield (
                f"{name}: the residual of {share} is more than noise, rounding and "
                "switching account for; its sensor, unit or sign may be wrong"
            )


def is_drowned(name: str, recorded: Array, residual: Array) -> bool:
    """Return whether a channel's noise exceeds a signal that is as the model has it, and no other one.

    Of y = m + n, m modelled and n noise without likeness to it, y² - n² is m², to 2 |m n| / √rows by chance.
    Of a signal without likeness to the model it is -m². The current along the flux, held at 0, is an example.
    """
    modelled, left = signal_size(name, recorded - residual), rms(residual)
    chance = 2 * EXPLANATION.drowned_errors * modelled * left / recorded.size**0.5
    found = signal_size(name, recorded) ** 2 - left**2
    return bool(found >= (1 - EXPLANATION.unresembled) * modelled**2 - chance)


def _phases(result: SearchResult) -> Iterator[str]:
    measured = result.objective.problem.measured
    if not all(name in measured for name in PHASES):
        return
    phases = np.stack([measured[name] for name in PHASES])
    size = rms(phases)
    total = phases.sum(axis=0)
    imbalance, noise = rms(total), max(robust_noise_level(total, 2), rounding_step(total) / 12**0.5)
    allowed = EXPLANATION.phase_sum * size + EXPLANATION.channel_noise * noise
    if imbalance <= allowed:
        return
    constant = float(total.mean())
    rest = rms(total - constant)
    if rest <= min(allowed, abs(constant)):
        yield (
            f"the phase currents add up to a constant {constant:+.3g} A, and not to 0: a zero error of one "
            "of the phases, the sum does not show of which; check each sensor without current"
        )
    else:
        yield (
            f"the phase currents add up to {_percent(imbalance, size)} of their rms, and not to 0; the scale "
            "of one of them or its sign is wrong, or one is missing"
        )


def _standing(result: SearchResult) -> Iterator[str]:
    """Yield the sensors of current and motion that show one value while the model moves."""
    problem = result.objective.problem
    if np.ptp(problem.recorded) == 0:
        yield (
            f"{problem.primary} shows {problem.recorded[0]:.3g} throughout, while the actuator moves; "
            "check its sensor and its line"
        )
    still = tuple(
        name
        for name in ("position_rad", "speed_rad_s")
        if name in problem.measured and np.ptp(problem.measured[name]) == 0
    )
    if not still or not set(still) <= set(comparable_channels(problem.actuator, problem.model)):
        return
    observing = replace(result.objective, problem=problem.observing(still))
    modelled = observing.outputs(result.point[np.newaxis])[0, : observing.channel_rows]
    for name, values in zip(still, modelled.reshape(len(still), -1), strict=True):
        if np.any(problem.measured[name]) and np.ptp(values) > 0:
            yield (
                f"{name} shows {problem.measured[name][0]:.3g} throughout, while by the current the actuator "
                "moves; it is jammed, or the sensor is frozen"
            )


def _described(name: str, result: SearchResult) -> float:
    return described_noise(name, result.objective.problem.actuator) or 0.0


def _nuisances(result: SearchResult) -> Iterator[str]:
    space, actuator = result.objective.space, result.objective.problem.actuator
    for name, values in space.nuisance_values(result.point[np.newaxis]).items():
        if sensor_error(name) is not None or not has_stated_prior(actuator, name):
            continue
        prior = usual_deviation(actuator, name)
        deviations = abs(float(values[0])) / prior
        if deviations > EXPLANATION.prior_deviations:
            unit = unit_of(name, actuator.coordinates)
            yield (
                f"{name}: the estimate of {values[0]:+.3g} {unit} is {deviations:.1f} standard deviations of "
                f"its prior ({prior:g} {unit}) off; the description or a channel's scale may be wrong"
            )


def _unit(result: SearchResult) -> Iterator[str]:
    """Yield the unit's parameters that are farther off than tolerances and calibration account for."""
    space, actuator = result.objective.space, result.objective.problem.actuator
    values, limit = space.nuisance_values(result.point[np.newaxis]), EXPLANATION.prior_deviations

    def off(name: str) -> float:
        # Population methods estimate faults alone.
        return float(values.get(BASELINE + name, [0.0])[0])

    tolerances, baseline = actuator.open_tolerances, actuator.baseline
    for name, deviation in tolerances.deviations.items() if tolerances else ():
        if abs(off(name)) > limit * deviation:
            yield (
                f"{name}: the estimate is {_deviation(name, off(name), actuator)} off the description, more "
                f"than its tolerance of ± {100 * getattr(tolerances, name):.3g} % accounts for; the "
                "description or a channel's scale may be wrong"
            )
    for name, deviation in baseline.deviations.items() if baseline else ():
        if abs(off(name)) > limit * deviation:
            yield (
                f"{name}: the estimate is {_deviation(name, off(name), actuator)} off its calibrated value, "
                f"{abs(off(name)) / deviation:.1f} standard errors of the calibration; the unit has changed "
                "in it, a channel's scale is wrong, or the calibration is: calibrate on other manoeuvres too"
            )


def _deviation(name: str, value: float, actuator: Actuator) -> str:
    if name in SIGNED:
        return f"{value:+.3g} {variation_unit(name, actuator.coordinates)}".removesuffix(" -")
    return f"{100 * math.expm1(value):+.3g} %"


def _unfollowed(result: SearchResult) -> Iterator[str]:
    scaled = {name.removesuffix("_scale") for name in _other_scales(result)}
    yield from unfollowed(
        result, [one for one in result.objective.problem.channels if sensor_of(one) in scaled]
    )


def _other_scales(result: SearchResult) -> dict[str, float]:
    """Return the estimated scales of sensors that are farther off than the prior has them, by name."""
    space, actuator = result.objective.space, result.objective.problem.actuator
    return {
        name: float(values[0])
        for name, values in space.nuisance_values(result.point[np.newaxis]).items()
        if error_kind(name) == "scale"
        and abs(float(values[0])) > EXPLANATION.prior_deviations * usual_deviation(actuator, name)
    }


def _scales(result: SearchResult) -> Iterator[str]:
    far = _other_scales(result)
    if len(far) > 1 and max(far.values()) < -1:
        channels = " and ".join(name.removesuffix("_scale") for name in far)
        yield f"{channels} are reversed; correct their wires, or give them sign = -1 under [channels]"
    elif len(far) > 1:
        sizes = ", ".join(f"{name} {100 * value:+.3g} %" for name, value in far.items())
        yield (
            f"several sensors seem to have another scale at once ({sizes}); check time_s and the rate of the "
            "recording, then the gain of the drive's own current sensor and the actuator's description"
        )


def _percent(part: float, whole: float) -> str:
    return f"{100 * part / whole:.3g} %" if whole > 0 else f"{part:.3g}"
