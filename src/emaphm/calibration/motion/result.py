"""Result of a calibration by inverse dynamics of measured motion."""

import math
from collections.abc import Sequence

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import (
    check_lumped_parameters,
    lumped_parameters,
    with_lumped_parameters,
)
from emaphm.actuator.unit.baseline import SIGNED
from emaphm.arrays import Array
from emaphm.calibration.campaign import CampaignRow
from emaphm.calibration.conditions import SAME_PARAMETER, common_factor
from emaphm.calibration.description import AUTO, MECHANICS, Description, Laws, laws_named
from emaphm.calibration.findings import LARGEST_ERROR, Parameter, RecordingResult, absolute_error
from emaphm.calibration.law_selection import parameters_of
from emaphm.calibration.motion.fit import MotionFit, check_measurable, coordinates
from emaphm.calibration.separation import MATTERS, CollinearParameters
from emaphm.errors import ActuatorError, MethodError
from emaphm.estimation.inverse_dynamics.result import ForceReplay
from emaphm.estimation.joint.contradictions import Contradictions, contradictions
from emaphm.estimation.joint.random_effects import random_effects
from emaphm.estimation.joint.uncertainty import AloneEstimates
from emaphm.estimation.replay import replay
from emaphm.estimation.space.parameter_variation import WIDEST_FACTOR, sizes

LEAST_SHARE = 1e-3
"""Least value to which the relative error of a positive parameter refers, relative to its description."""


def described_for_motion(
    rows: Sequence[CampaignRow], actuator: Actuator, free: Sequence[str] | None, laws: Laws
) -> Description:
    """Return the description with its `laws`, and the parameters to estimate by measured motion.

    Default parameters are inertia, viscous and Coulomb friction and a constant load, in addition to the
    parameters of the laws.

    Raises
    ------
    MethodError
        Measured motion cannot identify a law or parameter, or the laws are to be chosen automatically.
    """
    if laws == AUTO:
        raise MethodError(
            "laws are chosen only in closed loop; name the laws, or calibrate in closed loop (loop 'closed')"
        )
    requested, extended = laws_named(laws, actuator), actuator
    for law in requested:
        extended = extended if law.is_in(extended) else law.added_to(extended)
    of_laws = [name for law in requested for name in parameters_of(law, extended)]
    settled = {name for row in rows for name in (*row.known, *row.free)}
    if "coulomb_asymmetry" in of_laws:  # in motion, it has the effect of a constant load
        settled.add("offset")
    usual = [name for name in (*MECHANICS, "offset") if name not in settled]
    names = tuple(dict.fromkeys([*(usual if free is None else free), *of_laws]))
    if not names:
        raise MethodError("no parameter to calibrate; name some, such as inertia and coulomb")
    check_lumped_parameters(extended, names)
    check_measurable(rows, names)
    return Description(extended, names, requested)


def motion_covariance(fit: MotionFit, actuator: Actuator) -> Array:
    """Return the covariance (p, p) of the logarithms of positive parameters, and of the values of others.

    The prior of a parameter is the range of the search of a calibration.
    """
    names = tuple(fit.found.parameters)
    covariance = _relative_covariance(fit, actuator)
    if (contradicting := motion_contradictions(fit, actuator)) is not None:
        covariance = covariance + contradicting.covariance
    size = sizes(actuator, names)
    scale = np.array([s if name in SIGNED else 1.0 for name, s in zip(names, size, strict=True)])
    return np.asarray(np.outer(scale, scale) * covariance)


def _relative_covariance(fit: MotionFit, actuator: Actuator) -> Array:
    """Return the covariance (p, p) in the coordinates of a fit."""
    names = tuple(fit.found.parameters)
    described, size = lumped_parameters(actuator, names), sizes(actuator, names)
    unit = np.array(
        [
            one_size if name in SIGNED else max(abs(fit.found.values[name]), LEAST_SHARE * described[name])
            for name, one_size in zip(names, size, strict=True)
        ]
    )
    unit[unit == 0] = 1.0
    covariance = fit.covariance / np.outer(unit, unit)
    at_bound = [float(name in fit.found.at_bound) for name in names]
    widest = math.log(WIDEST_FACTOR)
    covariance = covariance + np.diag(at_bound) * widest**2
    deviations = coordinates(actuator, fit.found.values)
    scaled = common_factor(actuator, names, np.array([deviations.get(name, 0.0) for name in names]))
    covariance = covariance + fit.scale_deviation**2 * np.outer(scaled, scaled)
    # Combined with a prior of that width: (C⁻¹ + 1/w²)⁻¹ = C (I + C/w²)⁻¹, for any positive semidefinite C.
    limited = covariance @ np.linalg.inv(np.eye(len(names)) + covariance / widest**2)
    return np.asarray((limited + limited.T) / 2)


def motion_alone(fit: MotionFit, actuator: Actuator) -> AloneEstimates | None:
    """Return the estimates of each recording alone, in the coordinates of a fit; None for one recording.

    A recording that does not identify all parameters has the prior as its estimate.
    """
    if not fit.alone:
        return None
    names = tuple(fit.found.parameters)
    widest = np.full(len(names), math.log(WIDEST_FACTOR))
    points, covariances = (
        np.zeros((len(fit.alone), len(names))),
        np.tile(np.diag(widest**2), (len(fit.alone), 1, 1)),
    )
    for r, alone in enumerate(fit.alone):
        if alone is not None:
            deviations = coordinates(actuator, alone.found.values)
            points[r] = [deviations.get(name, -widest[0]) for name in names]
            covariances[r] = _relative_covariance(alone, actuator)
    ratios = np.ones(len(fit.alone))
    return AloneEstimates(points, covariances, ratios, random_effects(points, covariances, widest))


def motion_contradictions(fit: MotionFit, actuator: Actuator) -> Contradictions | None:
    """Return the contradictions between the recordings; None for one recording."""
    alone = motion_alone(fit, actuator)
    widest = np.full(len(fit.found.parameters), math.log(WIDEST_FACTOR))
    return None if alone is None else contradictions(alone, widest)


def motion_parameters(fit: MotionFit, covariance: Array, actuator: Actuator) -> dict[str, Parameter]:
    """Return the parameters with standard errors from `covariance` (p, p), and their identifiability."""
    names = tuple(fit.found.parameters)
    errors, size = np.sqrt(np.diag(covariance)), sizes(actuator, names)
    described = lumped_parameters(actuator, names)
    contradicting, parameters = motion_contradictions(fit, actuator), {}
    for i, (name, error) in enumerate(zip(names, errors, strict=True)):
        value, at_bound = fit.found.values[name], name in fit.found.at_bound
        signed, doubtful = name in SIGNED, contradicting is not None and bool(contradicting.contradicted[i])
        reasons = [_disagreement(fit, name)] if doubtful else []
        reasons += ["at the bound of its search: the recordings do not identify it"] if at_bound else []
        reasons += _out_of_range(value, fit.covariance[i, i] ** 0.5, described[name]) if not signed else []
        parameters[name] = Parameter(
            value,
            float(error if signed else max(absolute_error(value, float(error)), fit.covariance[i, i] ** 0.5)),
            fit.found.parameters[name].unit,
            identifiable=bool(error / (size[i] if signed else 1.0) < LARGEST_ERROR) and not at_bound,
            doubtful=doubtful,
            at_bound=at_bound,
            reason="; ".join(reasons),
        )
    return parameters


def _out_of_range(value: float, error: float, described: float) -> list[str]:
    """Return a reason if a positive value lies outside the range of the search of a closed-loop calibration.

    Least squares are linear in most parameters and can yield any value. A value of 0 is that of a parameter
    that the recordings do not identify.
    """
    if not (value > 0 and described > 0):
        return []
    too_small = value + 2 * error < described / WIDEST_FACTOR
    if not too_small and value - 2 * error <= described * WIDEST_FACTOR:
        return []
    return [
        (
            f"{value / described:.2g} times the description's value, beyond the factor of {WIDEST_FACTOR:g} "
            "that a calibration in closed loop searches: check the units of the recording, and that value"
        )
    ]


def _disagreement(fit: MotionFit, name: str) -> str:
    """Return a sentence with the estimates of a parameter by each recording alone."""
    i = list(fit.found.parameters).index(name)
    estimates = [
        f"{alone.found.values[name]:.3g} ± {alone.covariance[i, i] ** 0.5:.1g} "
        f"({alone.found.replays[0].source})"
        for alone in fit.alone
        if alone is not None
    ]
    return "the recordings contradict each other: alone they would have " + ", ".join(estimates)


def motion_collinear(fit: MotionFit, parameters: dict[str, Parameter]) -> tuple[CollinearParameters, ...]:
    """Return the sets of collinear parameters, except sets whose parameters are known well nevertheless."""

    def unsure(name: str) -> bool:
        parameter = parameters.get(name)
        return parameter is not None and parameter.standard_error > MATTERS * abs(parameter.value)

    return tuple(
        CollinearParameters(collinear.members, (), ())
        for collinear in fit.found.collinear
        if any(unsure(name) for name in collinear.members)
    )


def calibrated_by_motion(fit: MotionFit, actuator: Actuator, name: str) -> Actuator:
    """Return the actuator with the estimated values, called `name`.

    Raises
    ------
    MethodError
        A value is impossible, such as a stiffness of the load below 0.
    """
    try:
        return with_lumped_parameters(actuator, fit.found.values, name=name)
    except ActuatorError as error:
        raise MethodError(
            f"the estimates from the measured motion are impossible: {error}; free fewer parameters, or "
            "calibrate in closed loop (loop 'closed')"
        ) from None


def motion_recordings(
    fit: MotionFit, rows: Sequence[CampaignRow], calibrated: Actuator
) -> tuple[RecordingResult, ...]:
    """Return the result for each recording: its force error, and its replay in closed loop."""
    return tuple(
        _recording(row, force, loads, calibrated)
        for row, force, loads in zip(rows, fit.found.replays, fit.loads, strict=True)
    )


def _recording(
    row: CampaignRow, force: ForceReplay, loads: Sequence[str], calibrated: Actuator
) -> RecordingResult:
    own = {name: force.values[name] for name in row.free if name in force.values}
    estimated = {SAME_PARAMETER[name]: force.values[SAME_PARAMETER[name]] for name in loads}
    # A nuisance is the difference of the estimate from the description.
    usual = lumped_parameters(calibrated, tuple(estimated))
    nuisances = {name: estimated[SAME_PARAMETER[name]] - usual[SAME_PARAMETER[name]] for name in loads}
    described = with_lumped_parameters(calibrated, {**estimated, **row.parameters, **own})
    return RecordingResult(
        replay(row.completed(), described), nuisances, own, dict(row.known), None, force.relative_error
    )
