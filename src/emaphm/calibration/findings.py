"""What a joint fit has found, in the parameters' units: values, errors, contradictions, recordings' own."""

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
    """One calibrated parameter with its standard error, both in `unit`.

    Attributes
    ----------
    standard_error
        Of a positive parameter that is not identifiable, how far above its value it may be: such a parameter
        is known by its logarithm, within the `factor`, and its value may lie far below the truth.
    identifiable
        Whether the recordings determine it; a parameter at its bound is not.
    doubtful
        Whether the recordings contradict each other in it by more than their errors; the standard error
        covers it.
    at_bound
        Whether it has wandered to the bound of its search.
    reason
        How it is doubtful, or where it has wandered; empty else.
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
        """Its reason, and whether that makes it doubtful."""
        return f"doubtful: {self.reason}" if self.doubtful else self.reason

    @property
    def factor(self) -> float | None:
        """The factor that its standard error amounts to; None where the value is not above 0."""
        return 1 + self.standard_error / self.value if self.value > 0 else None


def absolute_error(value: float, error: float) -> float:
    """Return the standard error of a positive parameter in its unit, by that of its logarithm.

    The value times the error, as long as that is small. Beyond `LARGEST_ERROR` the product would say that a
    small value is known well; there it is how far above the value one standard error reaches.
    """
    return abs(value) * (math.expm1(error) if error >= LARGEST_ERROR else error)


@dataclass(frozen=True, eq=False)
class RecordingResult:
    """What a joint fit says of one recording.

    `replay` compares it with the calibrated model, under the load, temperature and whatever else was
    estimated of that recording: its `nuisances`, each in its unit, and its `own` parameters. `known` is what
    was given of it. `misfit_ratio` is its rms residual in the joint fit over that of a fit of it alone; None
    of one recording. `force_error` is the relative error of its torque by the measured motion; None in closed
    loop. `residual_over_noise` is its rms residual over what noise, rounding and switching explain; None by
    the measured motion.
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
        """Its mean load [N·m; N if linear], recorded or estimated, with that of the description."""
        recording, described = self.replay.recording, self.replay.actuator.mechanics.offset
        recorded = float(np.mean(recording["load_Nm"])) if "load_Nm" in recording else 0.0
        return described + recorded + self.nuisances.get("load", 0.0)


def found_values(fit: UnitFit, actuator: Actuator) -> dict[str, float]:
    """Return the calibrated values, in the parameters' units."""
    variations = sizes(actuator, fit.free) * fit.deviations
    values = {
        name: float(varied(actuator, name, variation))
        for name, variation in zip(fit.free, variations, strict=True)
    }
    return _sticking(values, actuator)


def _sticking(values: dict[str, float], actuator: Actuator) -> dict[str, float]:
    """Return `values` with static friction not below dynamic friction.

    Below it has no effect, so the search may have left it anywhere there.
    """
    if "static" in values:
        dynamic = values.get("coulomb", actuator.mechanics.dynamic_friction)
        values["static"] = max(values["static"], dynamic)
    return values


def found_parameters(
    fit: UnitFit, values: Mapping[str, float], rows: Sequence[CampaignRow], actuator: Actuator
) -> dict[str, Parameter]:
    """Return the calibrated parameters with their standard errors and what is doubtful in them."""
    size, parameters = sizes(actuator, fit.free), {}
    for i, (name, value) in enumerate(values.items()):
        error, at_bound = float(fit.standard_errors[i]), bool(fit.at_bound[i])
        doubtful = fit.contradicts(name)
        reasons = [_disagreement(fit, name, rows, actuator)] if doubtful else []
        if at_bound:
            reasons.append(
                f"at its bound, {WIDEST_FACTOR:g} times the description's value or a share of it as small: "
                "these recordings ask for an effect that it cannot make, or for none"
                if name not in SIGNED
                else "at its bound: these recordings ask for more of it than is sought"
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
    """Return a sentence on each recording that the others contradict: in what, and what was made of it."""
    if fit.contradictions is None:
        return ()
    lines = []
    for r, row in enumerate(rows):
        names = [fit.fitted[i] for i in np.flatnonzero(fit.contradictions.set_aside[r])]
        if names:
            alone = ", ".join(f"{name} {_asked(fit, r, name, actuator)}" for name in names)
            lines.append(
                f"{row.recording.source} contradicts the others: alone it has {alone}; the standard errors "
                "are by the scatter of the others; see what differs in it, or leave it out"
            )
    return tuple(lines)


def _disagreement(fit: UnitFit, name: str, rows: Sequence[CampaignRow], actuator: Actuator) -> str:
    """Return what each informed recording alone would have of a parameter, in words."""
    i = fit.fitted.index(name)
    assert fit.contradictions is not None  # noqa: S101 - it is contradicted
    asked = [
        f"{_asked(fit, r, name, actuator)} ({rows[r].recording.source})"
        for r in np.flatnonzero(fit.contradictions.informed[:, i]).tolist()
    ]
    return "the recordings contradict each other: alone they would have " + ", ".join(asked)


def _asked(fit: UnitFit, r: int, name: str, actuator: Actuator) -> str:
    """Return what recording `r` alone would have of a parameter, with its standard error."""
    alone, i = fit.uncertainty.alone, fit.fitted.index(name)
    assert alone is not None  # noqa: S101 - there are several recordings
    size = sizes(actuator, (name,))[0]
    value = float(varied(actuator, name, size * alone.points[r, i]))
    error = float(alone.covariances[r, i, i] ** 0.5) * (size if name in SIGNED else value)
    return f"{value:.3g} ± {error:.1g}"


def found_recordings(
    fit: UnitFit, rows: Sequence[CampaignRow], calibrated: Actuator
) -> tuple[RecordingResult, ...]:
    """Return what was found of each recording."""
    alone = fit.uncertainty.alone
    results = []
    for r, (row, term) in enumerate(zip(rows, fit.joint.terms, strict=True)):
        point, objective = fit.joint.local(r, fit.point), term.objective
        nuisances, described = objective.space.nuisances, objective.problem.actuator
        values = {name: float(value[0]) for name, value in nuisances.values(point[np.newaxis]).items()}
        own = {name: float(varied(described, name, np.asarray(values[BASELINE + name]))) for name in row.free}
        results.append(
            RecordingResult(
                _replayed(fit, r, row, calibrated),
                {name: values[name] for name in nuisances.chosen},
                own,
                dict(row.known),
                None if alone is None else float(alone.residual_ratios[r]),
                residual_over_noise=fit.lacks[r].ratio,
            )
        )
    return tuple(results)


def _replayed(fit: UnitFit, r: int, row: CampaignRow, calibrated: Actuator) -> Replay:
    """Return a recording replayed by the calibrated model, under what was estimated of it."""
    objective = fit.joint.terms[r].objective
    changed = objective.lumped_parameters(fit.joint.local(r, fit.point)[np.newaxis])
    values = _sticking({name: float(np.ravel(value)[0]) for name, value in changed.items()}, calibrated)
    that_day = with_lumped_parameters(calibrated, row.parameters | values)
    return replay(row.completed(), that_day)
