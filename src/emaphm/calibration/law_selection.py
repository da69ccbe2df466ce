"""Selection of the laws of a machine, one at a time, by the error in recordings left out of the fit.

Forward selection with cross-validation (Stone 1974; Hastie, Tibshirani and Friedman 2009, ch. 7.10): each
candidate law is fitted without some recordings and evaluated on them. The law that lowers the held-out error
most is added, if the gain exceeds its standard error.

A law whose gain was sufficient before another law was added in its place needs a smaller gain afterwards:
healthy recordings hardly distinguish the two laws, but faults do. For example, a compliant shaft and bristle
friction are similar in healthy recordings, but backlash has far less effect behind a compliant shaft.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from emaphm.actuator import Actuator, Faults
from emaphm.actuator.actuator import described_parts
from emaphm.actuator.laws import LAWS, Law
from emaphm.arrays import Array, rms
from emaphm.calibration.campaign import CampaignRow
from emaphm.calibration.conditions import joint_objective
from emaphm.calibration.held_out import folds, left_out_residual, subset
from emaphm.calibration.unit_fit import FitSettings
from emaphm.errors import MethodError
from emaphm.estimation.joint.correction import JointEstimate
from emaphm.estimation.joint.objective import JointObjective, RecordingTerm
from emaphm.estimation.joint.search import DESCENT, settle
from emaphm.estimation.levenberg_marquardt import descend
from emaphm.estimation.objective import LEAST_RESIDUAL
from emaphm.estimation.signal_size import signal_size
from emaphm.estimation.space.parameter_variation import ParameterVariation
from emaphm.optimizers import space_filling
from emaphm.progress import Progress
from emaphm.random_streams import child_seed

NO_LAW = "none"
"""Name of the description without an added law, in the table of a selection."""


@dataclass(frozen=True)
class CrossValidationSettings:
    """Settings of the cross-validation of laws.

    Each recording is left out once; more than `most_folds` recordings are left out in `most_folds` groups.
    The fit of a law starts from the description's fit and from `starts` points about the law's start value.
    A law that lowers the training error by less than the share `least_gain` is not cross-validated, and a law
    needs a held-out gain of at least `least_gain`, because the kinks of stick-slip change an error by this
    amount. A law that had such a gain before another law was added needs only `least_gain_again`. While a law
    of the unit is missing, nearly all other laws have some gain: for a six-step unit with a Stribeck speed,
    five laws had 2 to 5 % without it and 0.1 to 0.3 % with it. The sensor lag of a plant with three laws had
    2 % after one law and 1 % after two laws.
    """

    most_folds: int = 5
    starts: int = 6
    least_gain: float = 0.02
    least_gain_again: float = 0.005


CROSS_VALIDATION = CrossValidationSettings()


@dataclass(frozen=True)
class LawTrial:
    """Trial of one law, in addition to the laws `given` that had been chosen before.

    `training_error` and `held_out_error` are relative errors of the channels, as fractions: geometric means
    over channels and recordings. `held_out_error` is None if the law was not cross-validated. `evaluations`
    is the number of simulations of a recording.
    """

    law: str
    given: tuple[str, ...]
    training_error: float
    held_out_error: float | None
    seconds: float
    evaluations: int
    chosen: bool = False


def parameters_of(law: Law, actuator: Actuator) -> tuple[str, ...]:
    """Return the parameters that are free because of a law, in an `actuator` with this law."""
    return tuple(
        name for name in (*law.parameters, *law.also_free) if described_parts(actuator, name) is not None
    )


def typical_motor_speed(joint: JointObjective) -> float:
    """Return the largest rms motor speed [rad/s] of the recordings according to the described model."""
    problems = [term.objective.problem for term in joint.terms]
    return max(rms(problem.signals(Faults().vector)["speed_rad_s"]) for problem in problems)


@dataclass(frozen=True, eq=False)
class LawChoice:
    """Result of a selection: actuator with the chosen `laws`, free parameters, trials, and start values."""

    laws: tuple[Law, ...]
    actuator: Actuator
    free: tuple[str, ...]
    trials: tuple[LawTrial, ...]
    start: dict[str, float]


@dataclass(frozen=True, eq=False)
class _Fit:
    """Fit of a description with laws to all recordings.

    `training` (n,) and `held_out` (n,) are the logarithms of the error of each recording, in the fit and when
    it was left out; `held_out` is None without cross-validation.
    """

    actuator: Actuator
    free: tuple[str, ...]
    joint: JointObjective
    point: Array
    training: Array
    held_out: Array | None = None

    @property
    def shared(self) -> dict[str, float]:
        """Shared coordinates by parameter."""
        return dict(zip(self.free, self.point[: len(self.free)].tolist(), strict=True))


def select_laws(
    rows: Sequence[CampaignRow],
    base: JointEstimate,
    actuator: Actuator,
    free: tuple[str, ...],
    candidates: Sequence[Law],
    fit_settings: FitSettings,
    on_progress: Progress | None = None,
) -> LawChoice:
    """Return the laws among `candidates` that lower the error in recordings left out of the fit.

    `base` is the fit of `free` without these laws; the discrepancy of its model is used for all fits.

    Raises
    ------
    MethodError
        There is only one recording, so that none can be left out.
    """
    check_held_out(rows)
    trial = _Trials(rows, base, fit_settings)
    began = time.perf_counter()
    current = trial.cross_validated(trial.described(actuator, free))
    trials = [trial.record(NO_LAW, (), current, began, chosen=True)]
    remaining, chosen, had_gain = list(candidates), list[Law](), set[str]()
    while remaining:
        names = tuple(law.name for law in chosen)
        tried, gains = dict[str, tuple[_Fit, int]](), dict[str, float]()
        for i, law in enumerate(remaining):
            began = time.perf_counter()
            if on_progress is not None:
                on_progress((len(chosen) + i / len(remaining)) / (len(candidates) + 1))
            again = law.name in had_gain
            least = CROSS_VALIDATION.least_gain_again if again else CROSS_VALIDATION.least_gain
            fitted = trial.with_law(current, law, 0.0 if again else least)
            if fitted is None:
                continue
            # A law together with a law that it requires must have a gain over the required law alone.
            required = [tried[name][0] for name in law.needs if name in tried]
            exceeds_required = all(
                trial.gain(fit, fitted, least) > 0 for fit in required if fit.held_out is not None
            )
            gain = trial.gain(current, fitted, least)
            if gain > 0 and exceeds_required:
                gains[law.name] = gain
            tried[law.name] = fitted, len(trials)
            trials.append(trial.record(law.name, names, fitted, began))
        if not gains:
            break
        best = max(gains, key=gains.__getitem__)
        had_gain |= gains.keys()
        # A required law is added first; the law itself competes again in the next round.
        added = next((name for name in LAWS[best].needs if name in tried), best)
        current, number = tried[added]
        if current.held_out is None:
            current = trial.cross_validated(current)
        trials[number] = replace(trials[number], chosen=True, held_out_error=_mean_error(current.held_out))
        chosen.append(LAWS[added])
        remaining.remove(LAWS[added])
    return LawChoice(tuple(chosen), current.actuator, current.free, tuple(trials), current.shared)


def check_held_out(rows: Sequence[CampaignRow]) -> None:
    """Raise `MethodError` if there are too few recordings to leave one out."""
    if len(rows) < 2:
        raise MethodError(
            "laws are chosen by their error in recordings left out of the fit, which takes two recordings at "
            "least; add one of another manoeuvre, or name the laws"
        )


class _Trials:
    """Fits of a selection, with their common data; `runs` counts the simulations."""

    def __init__(self, rows: Sequence[CampaignRow], base: JointEstimate, fit_settings: FitSettings) -> None:
        self.rows, self.base, self.fit_settings = rows, base, fit_settings
        self.speed = typical_motor_speed(base.joint)
        self.runs = 0

    def described(self, actuator: Actuator, free: tuple[str, ...]) -> _Fit:
        """Return the fit of the base, without added laws."""
        joint = self.base.joint.corrected([discrepancy.mean for discrepancy in self.base.discrepancies])
        joint, point = settle(joint, self.base.point)
        return _Fit(actuator, free, joint, point, _log_errors(joint, point))

    def with_law(self, current: _Fit, law: Law, least: float) -> _Fit | None:
        """Return the fit with an additional law; None if the law is not possible.

        The fit is cross-validated if the law lowers the training error by at least the share `least`.
        """
        lacking = [LAWS[name] for name in law.needs if not LAWS[name].is_in(current.actuator)]
        if not all(needed.is_possible(current.actuator) for needed in (*lacking, law)):
            return None
        # Bristles include the Stribeck speed that gives them static friction; other laws need theirs first.
        if any(not set(needed.parameters) <= set(law.also_free) for needed in lacking):
            return None
        actuator = law.added_to(current.actuator, self.speed)
        free = tuple(dict.fromkeys((*current.free, *parameters_of(law, actuator))))
        joint = self._objective(current, actuator, free)
        first = len(current.free)
        begin = np.zeros(joint.box.lower.size)
        begin[:first] = current.point[:first]
        begin[len(free) :] = current.point[first:]
        starts = np.tile(begin, (1 + CROSS_VALIDATION.starts, 1))
        reach = np.minimum(joint.unit.widest[first:], 1.0)
        seed = child_seed(self.fit_settings.seed, "starts of a law", law.name)
        starts[1:, first : len(free)] = space_filling(CROSS_VALIDATION.starts, -reach, reach, seed)
        joint, point = settle(joint, descend(joint, starts, joint.box, DESCENT).best)
        fitted = _Fit(actuator, free, joint, point, _log_errors(joint, point))
        if np.mean(current.training - fitted.training) < least:
            return self._counted(fitted)
        return self.cross_validated(fitted)

    def _objective(self, current: _Fit, actuator: Actuator, free: tuple[str, ...]) -> JointObjective:
        """Return the objective with more free parameters, with the weights and corrections of `current`."""
        unit = ParameterVariation.free(actuator, free)
        settings = self.fit_settings
        # The same rows as in the base are compared, because its discrepancy is used for all fits.
        rigid = self.base.joint.terms[0].objective.problem.actuator.transmission is None
        joint = joint_objective(
            self.rows, actuator, unit, settings.nuisances, settings.workers, every_row=rigid
        )
        terms = []
        for new, old in zip(joint.terms, current.joint.terms, strict=True):
            problem = replace(new.objective.problem, weights=old.objective.problem.weights)
            objective = replace(old.objective, problem=problem, space=new.objective.space)
            correction = objective.of_channels(old.correction)
            terms.append(RecordingTerm(objective, new.shared, correction))
        return replace(joint, terms=tuple(terms))

    def cross_validated(self, fitted: _Fit) -> _Fit:
        """Return the fit with the error of each recording when it was left out."""
        count = len(fitted.joint.terms)
        held_out = np.empty(count)
        for left_out in folds(count, CROSS_VALIDATION.most_folds, self.fit_settings.seed):
            training_rows = [r for r in range(count) if r not in left_out]
            training, start = subset(fitted.joint, fitted.point, training_rows)
            shared = descend(training, start[np.newaxis], training.box, DESCENT).best[: training.shared]
            for r in left_out:
                held_out[r] = _held_out_error(fitted.joint, r, shared)
        return self._counted(replace(fitted, held_out=held_out))

    def _counted(self, fitted: _Fit) -> _Fit:
        problems = [term.objective.problem for term in fitted.joint.terms]
        self.runs = sum(problem.runs.of(problem.model)[0] for problem in problems)
        return fitted

    def gain(self, before: _Fit, after: _Fit, least: float) -> float:
        """Return the held-out gain (of the logarithm) of a law; 0 unless it exceeds chance and `least`."""
        if before.held_out is None or after.held_out is None:
            return 0.0
        gains = before.held_out - after.held_out
        mean, error = float(gains.mean()), float(gains.std(ddof=1)) / len(gains) ** 0.5
        return mean if mean > max(error, least) else 0.0

    def record(
        self, name: str, given: tuple[str, ...], fitted: _Fit, began: float, *, chosen: bool = False
    ) -> LawTrial:
        """Return the report of a trial."""
        held_out, training = _mean_error(fitted.held_out), float(np.exp(fitted.training.mean()))
        return LawTrial(name, given, training, held_out, time.perf_counter() - began, self.runs, chosen)


def _mean_error(held_out: Array | None) -> float | None:
    return None if held_out is None else float(np.exp(held_out.mean()))


def _log_errors(joint: JointObjective, point: Array) -> Array:
    """Return the logarithm of each recording's relative error at `point` (d,), mean over channels, (n,)."""
    residuals = joint.residuals(point)
    return np.array(
        [_log_error(term, residual) for term, residual in zip(joint.terms, residuals, strict=True)]
    )


def _log_error(term: RecordingTerm, residual: Array) -> float:
    """Return the mean over channels of log(rms residual / rms signal)."""
    objective, problem = term.objective, term.objective.problem
    by_channel = residual[: objective.channel_rows].reshape(len(problem.channels), -1)
    errors = [
        rms(rows) / (weight * signal_size(name, problem.measured[name]))
        for name, rows, weight in zip(problem.channels, by_channel, problem.weights, strict=True)
    ]
    return float(np.mean(np.log(np.maximum(errors, LEAST_RESIDUAL))))


def _held_out_error(joint: JointObjective, r: int, shared: Array) -> float:
    """Return the logarithm of the error of recording `r` under `shared` (p,), with its own estimated."""
    return _log_error(joint.terms[r], left_out_residual(joint, r, shared))
