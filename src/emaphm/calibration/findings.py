"""Results of a joint fit in the parameters' units: values, standard errors, contradictions, recordings."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import LUMPED_PARAMETERS, with_lumped_parameters
from emaphm.actuator.quantity import unit_for
from emaphm.actuator.unit.baseline import SIGNED
from emaphm.calibration.campaign import CampaignRow
from emaphm.calibration.unit_fit import UnitFit
from emaphm.estimation.replay import Replay, replay
from emaphm.estimation.space.nuisances import BASELINE
from emaphm.estimation.space.parameter_variation import WIDEST_FACTOR, sizes, varied

LARGEST_ERROR = 0.5
"""A parameter with a larger relative standard error is called not identifiable."""


@dataclass(frozen=True)
class Parameter:
    """Calibrated parameter with its standard error, both in `unit`.

    Attributes
    ----------
    standard_error
        Standard error. For a positive parameter that is not identifiable, the distance to the upper end of
        one standard error: such a parameter is known by its logarithm, within the `factor`, and the estimate
        may be far below the true value.
    identifiable
        Whether the recordings identify the parameter; a parameter at its bound is not identifiable.
    doubtful
        Whether the recordings contradict each other in this parameter by more than their errors; the standard
        error includes the contradiction.
    at_bound
        Whether the search ended at the parameter's bound.
    reason
        Explanation of `doubtful` or `at_bound`; otherwise empty.
    """

    value: float
    standard_error: float
    unit: str
    identifiable: bool
    doubtful: bool = False
    at_bound: bool = False
    reason: str = ""

    @property
    def remark(self) -> str:
        """The reason, marked if the parameter is doubtful."""
        return f"doubtful: {self.reason}" if self.doubtful else self.reason

    @property
    def factor(self) -> float | None:
        """Factor of one standard error, 1 + standard error / value; None if the value is not above 0."""
        return 1 + self.standard_error / self.value if self.value > 0 else None


def absolute_error(value: float, error: float) -> float:
    """Return the standard error of a positive parameter in its unit, from the error of its logarithm.

    For an error below `LARGEST_ERROR` it is value × error. Above, this product would suggest that a small
    value is known well; the distance to the upper end of one standard error, value × (exp(error) - 1), is
    returned instead.
    """
    return abs(value) * (math.expm1(error) if error >= LARGEST_ERROR else error)


@dataclass(frozen=True, eq=False)
class RecordingResult:
    """Result of a joint fit for one recording.

    `replay` compares the recording with the calibrated model under the estimates of this recording: its
    `nuisances`, each in its unit, and its `own` parameters. `known` are its given values. `misfit_ratio` is
    the rms residual in the joint fit divided by that of a fit of this recording alone; None for a single
    recording. `force_error` is the relative error of the torque by measured motion; None in closed loop.
    `residual_over_noise` is the rms residual divided by the rms that noise, rounding and switching explain;
    None by measured motion.
    """

    replay: Replay
    nuisances: Mapping[str, float]
    own: Mapping[str, float]
    known: Mapping[str, float]
    misfit_ratio: float | None
    force_error: float | None = None
    residual_over_noise: float | None = None

    @property
    def load(self) -> float:
        """Mean load [N·m; N if linear], recorded or estimated, plus the load of the description."""
        recording, described = self.replay.recording, self.replay.actuator.mechanics.offset
        recorded = float(np.mean(recording["load_Nm"])) if "load_Nm" in recording else 0.0
        return described + recorded + self.nuisances.get("load", 0.0)


def found_values(fit: UnitFit, actuator: Actuator) -> dict[str, float]:
    """Return the calibrated values in the parameters' units, by name."""
    variations = sizes(actuator, fit.free) * fit.deviations
    values = {
        name: float(varied(actuator, name, variation))
        for name, variation in zip(fit.free, variations, strict=True)
    }
    return _with_static_above_dynamic(values, actuator)


def _with_static_above_dynamic(values: dict[str, float], actuator: Actuator) -> dict[str, float]:
    """Return `values` with static friction not below dynamic friction.

    Below dynamic friction, static friction has no effect, so its estimate is arbitrary there.
    """
    if "static" in values:
        dynamic = values.get("coulomb", actuator.mechanics.dynamic_friction)
        values["static"] = max(values["static"], dynamic)
    return values


def found_parameters(
    fit: UnitFit, values: Mapping[str, float], rows: Sequence[CampaignRow], actuator: Actuator
) -> dict[str, Parameter]:
    """Return the calibrated parameters with their standard errors and doubts."""
    size, parameters = sizes(actuator, fit.free), {}
    for i, (name, value) in enumerate(values.items()):
        error, at_bound = float(fit.standard_errors[i]), bool(fit.at_bound[i])
        doubtful = fit.contradicts(name)
        reasons = [_disagreement(fit, name, rows, actuator)] if doubtful else []
        if at_bound:
            reasons.append(
                f"at its bound, {WIDEST_FACTOR:g} times the description's value or a share of it as small: "
                "these recordings require an effect that this parameter cannot have, or no effect"
                if name not in SIGNED
                else "at its bound: these recordings require a value outside the range of the search"
            )
        parameters[name] = Parameter(
            value,
            float(error * size[i]) if name in SIGNED else absolute_error(value, error),
            unit_for(LUMPED_PARAMETERS[name], actuator.coordinates),
            identifiable=bool(error < LARGEST_ERROR) and not at_bound,
            doubtful=doubtful,
            at_bound=at_bound,
            reason="; ".join(reasons),
        )
    return parameters


def set_aside_warnings(fit: UnitFit, rows: Sequence[CampaignRow], actuator: Actuator) -> tuple[str, ...]:
    """Return a sentence on each recording that was set aside because it contradicts the others."""
    if fit.contradictions is None:
        return ()
    lines = []
    for r, row in enumerate(rows):
        names = [fit.fitted[i] for i in np.flatnonzero(fit.contradictions.set_aside[r])]
        if names:
            alone = ", ".join(f"{name} {_estimate_alone(fit, r, name, actuator)}" for name in names)
            lines.append(
                f"{row.recording.source} contradicts the others: alone it has {alone}; the standard errors "
                "follow from the scatter of the others; find out what differs in this recording, or leave it "
                "out"
            )
    return tuple(lines)


def _disagreement(fit: UnitFit, name: str, rows: Sequence[CampaignRow], actuator: Actuator) -> str:
    """Return a sentence with the estimates of a parameter by each informative recording alone."""
    i = fit.fitted.index(name)
    assert fit.contradictions is not None  # noqa: S101 - the parameter is contradicted
    estimates = [
        f"{_estimate_alone(fit, r, name, actuator)} ({rows[r].recording.source})"
        for r in np.flatnonzero(fit.contradictions.informed[:, i]).tolist()
    ]
    return "the recordings contradict each other: alone they would have " + ", ".join(estimates)


def _estimate_alone(fit: UnitFit, r: int, name: str, actuator: Actuator) -> str:
    """Return the estimate of a parameter by recording `r` alone, with its standard error, as text."""
    alone, i = fit.uncertainty.alone, fit.fitted.index(name)
    assert alone is not None  # noqa: S101 - there are several recordings
    size = sizes(actuator, (name,))[0]
    value = float(varied(actuator, name, size * alone.points[r, i]))
    error = float(alone.covariances[r, i, i] ** 0.5) * (size if name in SIGNED else value)
    return f"{value:.3g} ± {error:.1g}"


def found_recordings(
    fit: UnitFit, rows: Sequence[CampaignRow], calibrated: Actuator
) -> tuple[RecordingResult, ...]:
    """Return the result for each recording."""
    alone = fit.uncertainty.alone
    results = []
    for r, (row, term) in enumerate(zip(rows, fit.joint.terms, strict=True)):
        point, objective = fit.joint.local(r, fit.point), term.objective
        nuisances, described = objective.space.nuisances, objective.problem.actuator
        values = {name: float(value[0]) for name, value in nuisances.values(point[np.newaxis]).items()}
        own = {name: float(varied(described, name, np.asarray(values[BASELINE + name]))) for name in row.free}
        results.append(
            RecordingResult(
                _replay_of(fit, r, row, calibrated),
                {name: values[name] for name in nuisances.chosen},
                own,
                dict(row.known),
                None if alone is None else float(alone.residual_ratios[r]),
                residual_over_noise=fit.lacks[r].ratio,
            )
        )
    return tuple(results)


def _replay_of(fit: UnitFit, r: int, row: CampaignRow, calibrated: Actuator) -> Replay:
    """Return the replay of recording `r` by the calibrated model with the estimates of this recording."""
    objective = fit.joint.terms[r].objective
    changed = objective.lumped_parameters(fit.joint.local(r, fit.point)[np.newaxis])
    values = _with_static_above_dynamic(
        {name: float(np.ravel(value)[0]) for name, value in changed.items()}, calibrated
    )
    as_recorded = with_lumped_parameters(calibrated, row.parameters | values)
    return replay(row.completed(), as_recorded)
