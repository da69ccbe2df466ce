"""Selection of the laws that a machine has: one at a time, by the error in recordings left out of the fit.

Forward selection with cross-validation (Stone 1974; Hastie, Tibshirani and Friedman 2009, ch. 7.10): each law
that may be added is fitted to all recordings but some, and judged on those. Of the laws left, the one that
lowers the held-out error most is taken, as long as it does so by more than the standard error of that gain.

A law that was worth it before another took its place is taken after all for a smaller gain: healthy
recordings hardly tell the two apart, but faults do. Behind a shaft that gives a backlash shows far less than
in a rigid unit with bristle friction, and healthy both look alike.
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
"""Name of the description without a further law, in the table of a selection."""


@dataclass(frozen=True)
class CrossValidationSettings:
    """How laws are tried by cross-validation.

    Up to `most_folds` recordings each is left out once, of more as many groups. A law is fitted from the
    description's fit and `starts` points about its own start value. One that lowers the training error by
    less than the share `least_gain` is not cross-validated, and none is taken for a held-out gain below it:
    so much the kinks of stick-slip make of an error. Of a law that has had such a gain before another was
    taken, `least_gain_again` is asked. While a law is missing that the unit has, nearly all others gain
    something: of a six-step unit with a Stribeck speed, five had 2 to 5 % without it and 0.1 to 0.3 % with
    it. The lag of the sensors of a plant with three laws had 2 % when one was taken, and 1 % after two.
    """

    most_folds: int = 5
    starts: int = 6
    least_gain: float = 0.02
    least_gain_again: float = 0.005


CROSS_VALIDATION = CrossValidationSettings()


@dataclass(frozen=True)
class LawTrial:
    """One law that was tried, with those `given` that had been chosen before.

    `training_error` and `held_out_error` are relative errors of the channels, as fractions: the geometric
    mean over channels and recordings. `held_out_error` is None where the law was not cross-validated.
    `evaluations` are simulations of a recording.
    """

    law: str
    given: tuple[str, ...]
    training_error: float
    held_out_error: float | None
    seconds: float
    evaluations: int
    chosen: bool = False


def parameters_of(law: Law, actuator: Actuator) -> tuple[str, ...]:
    """Return the parameters that a law makes free in an `actuator` that has it."""
    return tuple(
        name for name in (*law.parameters, *law.also_free) if described_parts(actuator, name) is not None
    )


def typical_motor_speed(joint: JointObjective) -> float:
    """Return the largest rms motor speed [rad/s] of the recordings, by the described model."""
    problems = [term.objective.problem for term in joint.terms]
    return max(rms(problem.signals(Faults().vector)["speed_rad_s"]) for problem in problems)


@dataclass(frozen=True, eq=False)
class LawChoice:
    """The actuator with the chosen `laws`, the free parameters, the trials, and a point to start from."""

    laws: tuple[Law, ...]
    actuator: Actuator
    free: tuple[str, ...]
    trials: tuple[LawTrial, ...]
    start: dict[str, float]


@dataclass(frozen=True, eq=False)
class _Fit:
    """A description with laws, fitted to all recordings, and judged on those left out if `held_out` is set.

    `held_out` is the logarithm of each recording's error where it was left out, (n,).
    """

    actuator: Actuator
    free: tuple[str, ...]
    joint: JointObjective
    point: Array
    training: Array
    held_out: Array | None = None

    @property
    def shared(self) -> dict[str, float]:
        """The shared coordinates by parameter."""
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
    """Return the laws among `candidates` that lower the error in recordings left out.

    `base` is the fit of `free` without them; the discrepancy of its model is taken for that of all.

    Raises
    ------
    MethodError
        There is one recording only, so that none can be left out.
    """
    check_held_out(rows)
    trial = _Trials(rows, base, fit_settings)
    began = time.perf_counter()
    current = trial.cross_validated(trial.described(actuator, free))
    trials = [trial.record(NO_LAW, (), current, began, chosen=True)]
    left, chosen, shown = list(candidates), list[Law](), set[str]()
    while left:
        names = tuple(law.name for law in chosen)
        tried, gains = dict[str, tuple[_Fit, int]](), dict[str, float]()
        for i, law in enumerate(left):
            began = time.perf_counter()
            if on_progress is not None:
                on_progress((len(chosen) + i / len(left)) / (len(candidates) + 1))
            is_shown = law.name in shown
            least = CROSS_VALIDATION.least_gain_again if is_shown else CROSS_VALIDATION.least_gain
            fitted = trial.with_law(current, law, 0.0 if is_shown else least)
            if fitted is None:
                continue
            # With a law that it needs it must be worth more than that law alone.
            alone = [tried[name][0] for name in law.needs if name in tried]
            is_more = all(trial.gain(one, fitted, least) > 0 for one in alone if one.held_out is not None)
            gain = trial.gain(current, fitted, least)
            if gain > 0 and is_more:
                gains[law.name] = gain
            tried[law.name] = fitted, len(trials)
            trials.append(trial.record(law.name, names, fitted, began))
        if not gains:
            break
        best = max(gains, key=gains.__getitem__)
        shown |= gains.keys()
        # What it needs is taken first: on that it competes with others in the next round.
        taken = next((name for name in LAWS[best].needs if name in tried), best)
        current, number = tried[taken]
        if current.held_out is None:
            current = trial.cross_validated(current)
        trials[number] = replace(trials[number], chosen=True, held_out_error=_mean_error(current.held_out))
        chosen.append(LAWS[taken])
        left.remove(LAWS[taken])
    return LawChoice(tuple(chosen), current.actuator, current.free, tuple(trials), current.shared)


def check_held_out(rows: Sequence[CampaignRow]) -> None:
    """Refuse to judge laws where no recording can be left out."""
    if len(rows) < 2:
        raise MethodError(
            "laws are chosen by their error in recordings left out of the fit, which takes two recordings at "
            "least; add one of another manoeuvre, or name the laws"
        )


class _Trials:
    """What all fits of a selection share; counts the simulations."""

    def __init__(self, rows: Sequence[CampaignRow], base: JointEstimate, fit_settings: FitSettings) -> None:
        self.rows, self.base, self.fit_settings = rows, base, fit_settings
        self.speed = typical_motor_speed(base.joint)
        self.runs = 0

    def described(self, actuator: Actuator, free: tuple[str, ...]) -> _Fit:
        """Return the fit without any law: that of the base."""
        joint = self.base.joint.corrected([one.mean for one in self.base.discrepancies])
        joint, point = settle(joint, self.base.point)
        return _Fit(actuator, free, joint, point, _log_errors(joint, point))

    def with_law(self, current: _Fit, law: Law, least: float) -> _Fit | None:
        """Return the fit with a further law; None if not possible.

        It is cross-validated if it lowers the training error by the share `least`.
        """
        lacking = [LAWS[name] for name in law.needs if not LAWS[name].is_in(current.actuator)]
        if not all(one.is_possible(current.actuator) for one in (*lacking, law)):
            return None
        # Bristles come with the Stribeck speed that gives them static friction; others build on another law.
        if any(not set(one.parameters) <= set(law.also_free) for one in lacking):
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
        """Return the objective with further free parameters, weighted and corrected as at `current`."""
        unit = ParameterVariation.free(actuator, free)
        settings = self.fit_settings
        # The rows of the base are compared, whose discrepancy is taken for that of all.
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
        """Return the fit with the error of each recording where it was left out."""
        count = len(fitted.joint.terms)
        held_out = np.empty(count)
        for left_out in folds(count, CROSS_VALIDATION.most_folds, self.fit_settings.seed):
            kept = [r for r in range(count) if r not in left_out]
            training, start = subset(fitted.joint, fitted.point, kept)
            shared = descend(training, start[np.newaxis], training.box, DESCENT).best[: training.shared]
            for r in left_out:
                held_out[r] = _held_out_error(fitted.joint, r, shared)
        return self._counted(replace(fitted, held_out=held_out))

    def _counted(self, fitted: _Fit) -> _Fit:
        problems = [term.objective.problem for term in fitted.joint.terms]
        self.runs = sum(problem.runs.of(problem.model)[0] for problem in problems)
        return fitted

    def gain(self, before: _Fit, after: _Fit, least: float) -> float:
        """Return the held-out gain (of the logarithm) of a law that is beyond chance and `least`, else 0."""
        if before.held_out is None or after.held_out is None:
            return 0.0
        gains = before.held_out - after.held_out
        mean, error = float(gains.mean()), float(gains.std(ddof=1)) / len(gains) ** 0.5
        return mean if mean > max(error, least) else 0.0

    def record(
        self, name: str, given: tuple[str, ...], fitted: _Fit, began: float, *, chosen: bool = False
    ) -> LawTrial:
        """Return what is reported of a trial."""
        held_out, training = _mean_error(fitted.held_out), float(np.exp(fitted.training.mean()))
        return LawTrial(name, given, training, held_out, time.perf_counter() - began, self.runs, chosen)


def _mean_error(held_out: Array | None) -> float | None:
    return None if held_out is None else float(np.exp(held_out.mean()))


def _log_errors(joint: JointObjective, point: Array) -> Array:
    """Return the logarithm of each recording's relative error at `point` (d,), its channels' mean, (n,)."""
    residuals = joint.residuals(point)
    return np.array(
        [_log_error(term, residual) for term, residual in zip(joint.terms, residuals, strict=True)]
    )


def _log_error(term: RecordingTerm, residual: Array) -> float:
    """Return the mean over channels of the logarithm of rms residual over rms signal."""
    objective, problem = term.objective, term.objective.problem
    by_channel = residual[: objective.channel_rows].reshape(len(problem.channels), -1)
    errors = [
        rms(one) / (weight * signal_size(name, problem.measured[name]))
        for name, one, weight in zip(problem.channels, by_channel, problem.weights, strict=True)
    ]
    return float(np.mean(np.log(np.maximum(errors, LEAST_RESIDUAL))))


def _held_out_error(joint: JointObjective, r: int, shared: Array) -> float:
    """Return the logarithm of the error of recording `r` under `shared` (p,); only its own is estimated."""
    return _log_error(joint.terms[r], left_out_residual(joint, r, shared))
