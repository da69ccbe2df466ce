"""Estimates that deviate too far from their priors: nuisances, parameters of the unit, sensor scales."""

import math
from collections.abc import Iterator

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.unit.baseline import SIGNED
from emaphm.diagnosis.explanation.settings import EXPLANATION
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.sensors.sensor_model import error_kind, sensor_error
from emaphm.estimation.space.nuisances import BASELINE, has_stated_prior, unit_of, usual_deviation
from emaphm.estimation.space.parameter_variation import variation_unit


def far_nuisances(result: SearchResult) -> Iterator[str]:
    """Yield a sentence on each nuisance too far from its stated prior; sensor errors are not included."""
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
                f"its prior ({prior:g} {unit}) from nominal; the description or a channel's scale may be "
                "wrong"
            )


def far_parameters(result: SearchResult) -> Iterator[str]:
    """Yield a sentence on each parameter of the unit too far from its tolerance or calibration."""
    space, actuator = result.objective.space, result.objective.problem.actuator
    values, limit = space.nuisance_values(result.point[np.newaxis]), EXPLANATION.prior_deviations

    def deviation_of(name: str) -> float:
        # Population methods estimate only faults.
        return float(values.get(BASELINE + name, [0.0])[0])

    tolerances, baseline = actuator.open_tolerances, actuator.baseline
    for name, deviation in tolerances.deviations.items() if tolerances else ():
        if abs(deviation_of(name)) > limit * deviation:
            yield (
                f"{name}: the estimate is {_deviation(name, deviation_of(name), actuator)} off the "
                f"description, more than its tolerance of ± {100 * getattr(tolerances, name):.3g} % "
                "accounts for; the description or a channel's scale may be wrong"
            )
    for name, deviation in baseline.deviations.items() if baseline else ():
        if abs(deviation_of(name)) > limit * deviation:
            yield (
                f"{name}: the estimate is {_deviation(name, deviation_of(name), actuator)} off its "
                f"calibrated value, {abs(deviation_of(name)) / deviation:.1f} standard errors of the "
                "calibration; the parameter has changed, a channel's scale is wrong, or the calibration is "
                "wrong: calibrate on further manoeuvres"
            )


def _deviation(name: str, value: float, actuator: Actuator) -> str:
    """Return a deviation as text, in percent if the logarithm is estimated."""
    if name in SIGNED:
        return f"{value:+.3g} {variation_unit(name, actuator.coordinates)}".removesuffix(" -")
    return f"{100 * math.expm1(value):+.3g} %"


def other_scales(result: SearchResult) -> dict[str, float]:
    """Return the estimated scales of sensors too far from their priors, by name."""
    space, actuator = result.objective.space, result.objective.problem.actuator
    return {
        name: float(values[0])
        for name, values in space.nuisance_values(result.point[np.newaxis]).items()
        if error_kind(name) == "scale"
        and abs(float(values[0])) > EXPLANATION.prior_deviations * usual_deviation(actuator, name)
    }


def several_scales(result: SearchResult) -> Iterator[str]:
    """Yield a sentence if several sensors have another scale, or are reversed."""
    far = other_scales(result)
    if len(far) > 1 and max(far.values()) < -1:
        channels = " and ".join(name.removesuffix("_scale") for name in far)
        yield f"{channels} are reversed; correct their wires, or give them sign = -1 under [channels]"
    elif len(far) > 1:
        sizes = ", ".join(f"{name} {100 * value:+.3g} %" for name, value in far.items())
        yield (
            f"several sensors seem to have another scale at once ({sizes}); check time_s and the rate of the "
            "recording, then the gain of the drive's own current sensor and the actuator's description"
        )
