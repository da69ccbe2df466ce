"""A diagnosis with the help of an estimator: its answer alone, or corrected by a search that begins there."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.argument import check_actuator
from emaphm.amortized.applicability.delays import found_delay, in_time_and_moved
from emaphm.amortized.applicability.likeness import Unlikeness, unlikeness
from emaphm.amortized.drawing import PRIOR, SHORTS
from emaphm.amortized.error_prediction.comparison import RUNS, Comparison
from emaphm.amortized.error_prediction.deviations import OTHERS
from emaphm.amortized.error_prediction.other_explanations import other_explanations
from emaphm.amortized.estimator import Estimator
from emaphm.amortized.networks.mixture import Mixture
from emaphm.blas_threads import one_blas_thread
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.diagnosis.diagnose import nuisance_estimates
from emaphm.diagnosis.explanation.cautions import cautions
from emaphm.diagnosis.explanation.motion import moves_at
from emaphm.diagnosis.explanation.one_way import undecided_where_one_way
from emaphm.diagnosis.explanation.reasons import reasons_against
from emaphm.diagnosis.result import ESTIMATOR
from emaphm.diagnosis.verdict import estimates
from emaphm.estimation.bias_correction import MAX_CORRECTIONS
from emaphm.estimation.methods import WITH_LEAST_SQUARES
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.posterior.samples import Posterior
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.estimation.starts import Starts
from emaphm.progress import Progress
from emaphm.random_streams import stream
from emaphm.recording import Recording, check_plausible, with_equivalent_current
from emaphm.recording.argument import check_recording
from emaphm.recording.sensor_checks import check_sensors
from emaphm.version import VERSION

CORRECTED = ESTIMATOR + WITH_LEAST_SQUARES
"""What a diagnosis is called where least squares have gone on from the network's answer."""

LEAST_WEIGHT, SEPARATION = 0.05, 3.0
"""Weight of a mixture's component, and its distance from the mean in standard deviations, from which on a
search begins there too: each start more leaves fewer runs of the reference model for the others."""

WIDE, DRAWS = 0.04, 6
"""Standard deviation of a fault from which on a search begins at draws from the answer too, and how many. It
does so wherever all phases are shorted heavily: kinks hold a single descent there."""

FARTHEST = 3.5
"""Distance from the answer in its standard deviations from which on the end of a search that began there is
not believed: kinks have led it astray, or the answer was wrong."""

SAMPLES = 1000
"""Samples of the answer that its credible intervals are taken from."""


@one_blas_thread()
def diagnose_by(
    estimator: Estimator,
    recording: Recording,
    actuator: Actuator,
    *,
    fast: bool = False,
    max_corrections: int = MAX_CORRECTIONS,
    nuisances: Sequence[str] | None = None,
    posterior: bool = False,
    seed: int = 0,
    workers: int | None = None,
    on_progress: Progress | None = None,
) -> Diagnosis:
    """Return the faults of `actuator` that explain `recording`, found by its estimator.

    Where a sensor's own signal shows a fault, or the recording is unlike those that the estimator was trained
    on, it is diagnosed as without one, and a note says why; `method` is "hybrid" then.

    Parameters
    ----------
    fast
        Whether the answer of the network alone will do, as long as the averaged model explains the recording
        there: "estimator". Else it is where the search begins, in place of the global stage, and the bias
        correction follows: "estimator+lsq".
    max_corrections, nuisances, posterior, seed, workers, on_progress
        As for `emaphm.diagnose`; what the network alone estimates is what it was trained on.

    Raises
    ------
    MethodError
        The estimator is for another actuator, manoeuvre, rate or channels; or as for `emaphm.diagnose`.
    RecordingError
        `recording` is no `Recording`, or cannot be of this actuator, by orders of magnitude.
    ActuatorError
        `actuator` is no `Actuator`.
    """
    began = time.perf_counter()
    asked = _Asked.of(estimator, recording, actuator, seed, alone=fast)
    recording, mixture = asked.recording, asked.mixture
    starts = None
    if asked.answer is None:
        note = f"the estimator is not believed: {'; '.join(asked.reasons)}; all of the range was searched"
        recording = recording.with_channels(recording.channels, [note])
    else:
        if fast and not asked.reasons:
            return asked.answer.diagnosis(recording, seed, began)
        if fast:
            note = f"the estimator's answer was corrected: {'; '.join(asked.reasons)}"
            recording = recording.with_channels(recording.channels, [note])
        starts = _starts(mixture, estimator.space, seed)

    def searched(recording: Recording, starts: Starts | None) -> Diagnosis:
        return diagnose(
            recording,
            actuator,
            max_corrections=max_corrections,
            nuisances=nuisances,
            seed=seed,
            workers=workers,
            posterior=posterior,
            starts=starts,
            on_progress=on_progress,
        )

    diagnosis = searched(recording, starts)
    led_astray = _led_astray(mixture, estimator.space, diagnosis)
    if led_astray is not None:
        note = f"{led_astray}; all of the range was searched"
        diagnosis = searched(recording.with_channels(recording.channels, [note]), None)
    return replace(diagnosis, seconds=time.perf_counter() - began)


@one_blas_thread()
def answer_alone(
    estimator: Estimator, recording: Recording, actuator: Actuator, *, seed: int = 0
) -> Diagnosis | tuple[str, ...]:
    """Return the diagnosis by the network alone, or why it is not taken as it is, a clause each.

    As `diagnose_by` with `fast`, but nothing is searched where the answer will not do.

    Parameters
    ----------
    estimator
        One of `emaphm.train_estimator`, or `Estimator.load` of its file.
    recording, actuator
        Of the manoeuvre and the description that it was trained for.
    seed
        Source of all randomness.

    Raises
    ------
    MethodError
        The estimator is for another actuator, manoeuvre, rate or channels.
    RecordingError
        The recording cannot be of this actuator, by orders of magnitude.
    """
    began = time.perf_counter()
    asked = _Asked.of(estimator, recording, actuator, seed, alone=True)
    if asked.answer is None or asked.reasons:
        return asked.reasons
    return asked.answer.diagnosis(asked.recording, seed, began)


def _led_astray(mixture: Mixture, space: ParameterSpace, diagnosis: Diagnosis) -> str | None:
    """Return why the end of a search that began at the answer is not believed, None where it is.

    A law that the description lacks takes up what a wrong answer leaves as well.
    """
    if diagnosis.method != CORRECTED:
        return None
    name, deviations = _farthest(mixture, space, diagnosis)
    if deviations > FARTHEST:
        return (
            f"least squares led away from the estimator's answer, by {deviations:.2g} of its standard "
            f"deviations in {name}"
        )
    if diagnosis.laws:
        return f"the search from the estimator's answer found laws: {', '.join(diagnosis.laws)}"
    return None


def _farthest(mixture: Mixture, space: ParameterSpace, diagnosis: Diagnosis) -> tuple[str, float]:
    """Return the fault in which a diagnosis differs most from the answer, in its standard deviations."""
    faults = len(space.columns)
    away = np.abs(space.points(diagnosis.faults.vector) - mixture.mean)[:faults]
    away /= np.sqrt(np.diag(mixture.covariance))[:faults]
    return space.coordinates[int(away.argmax())], float(away.max())


def _starts(mixture: Mixture, space: ParameterSpace, seed: int) -> Starts:
    """Return where a search begins: at the answer, and where a descent may be held also at draws from it."""
    points = mixture.starts(LEAST_WEIGHT, SEPARATION)
    deviations = np.sqrt(np.diag(mixture.covariance))[: len(space.columns)]
    shorts = space.faults(space.project(points[:1]))[0, SHORTS]
    if deviations.max() > WIDE or shorts.min() > PRIOR.heavy_short[0]:
        points = np.vstack([points, mixture.inside(space, DRAWS, stream(seed, "starts from the answer"))])
    return Starts(ESTIMATOR, points, space.coordinates)


def _objective(estimator: Estimator, recording: Recording, actuator: Actuator) -> MapObjective:
    """Return the averaged model against the recording, in the coordinates of the estimator."""
    problem = problem_of(recording, actuator, workers=1, channels=estimator.setup.channels)
    # A recorded temperature is one of the coordinates here, which the network has estimated.
    return MapObjective.of(replace(problem, temperature_rise_K=0.0), estimator.space)


@dataclass(frozen=True, eq=False)
class _Answer:
    """What the network says, and the residual that the averaged model has at its mean.

    `compared` is how many recordings the network was asked about: the one, and it with channels moved.
    """

    mixture: Mixture
    result: SearchResult
    moves: bool
    reasons: tuple[str, ...]
    compared: int

    @classmethod
    def of(cls, mixture: Mixture, objective: MapObjective, seed: int, compared: int, *, alone: bool) -> Self:
        """Return the answer, with the reasons why it will not do as it is.

        The averaged model there does not explain the recording, or its faults may be something else; asked
        where no search follows, `alone`.
        """
        result = SearchResult.at(objective, objective.space.project(mixture.mean))
        moves = moves_at(objective, result.point)
        if not alone:
            return cls(mixture, result, moves, (), compared)
        reasons = _left_unexplained(result, seed, moves=moves)
        if moves and not reasons:
            reasons = other_explanations(result, mixture.covariance, seed)
        return cls(mixture, result, moves, reasons, compared)

    def diagnosis(self, recording: Recording, seed: int, began: float) -> Diagnosis:
        """Return the diagnosis by the network alone."""
        objective, point, covariance = self.result.objective, self.result.point, self.mixture.covariance
        problem, space = objective.problem, objective.space
        residual = self.result.fitted_residual[: problem.samples]
        samples = self.mixture.inside(space, SAMPLES, stream(seed, "samples of the answer"))
        averaged, reference = problem.runs.of(problem.model)
        components = undecided_where_one_way(estimates(space, point, covariance), self.result)
        return Diagnosis(
            components=components,
            coordinates=space.coordinates,
            covariance=covariance,
            method=ESTIMATOR,
            model=problem.model.name,
            fitness_name="least_squares",
            fitness=self.result.cost,
            residual_rms_A=float(np.sqrt(np.mean(residual**2))),
            explained=True,
            evaluations=averaged + self.compared * (RUNS + OTHERS + space.dimensions + 1),
            reference_runs=reference,
            seconds=time.perf_counter() - began,
            seed=seed,
            recording=recording.source,
            actuator=problem.actuator,
            version=VERSION,
            time_s=recording["time_s"],
            recorded=problem.recorded,
            modelled=problem.recorded - residual,
            channels=problem.channels,
            recording_notes=(*recording.notes, *cautions(components, self.result, moves=self.moves)),
            nuisances=nuisance_estimates(objective, point, covariance),
            moves=self.moves,
            posterior=Posterior.of(space, samples, None),
        )


def _left_unexplained(result: SearchResult, seed: int, *, moves: bool) -> tuple[str, ...]:
    """Return why the averaged model at an answer does not explain the recording, a clause each."""
    objective = result.objective
    # No Jacobians: they are asked for after a correction only.
    none = np.zeros((1, objective.space.dimensions, objective.channel_rows))
    return reasons_against(result, none, {}, seed, moves=moves)


@dataclass(frozen=True, eq=False)
class _Asked:
    """What an estimator makes of a recording.

    `answer` is None where it is not believed. `reasons` say why it is not, or why the averaged model at the
    answer does not explain the recording; none where the answer will do.
    """

    recording: Recording
    mixture: Mixture
    answer: _Answer | None
    reasons: tuple[str, ...]

    @classmethod
    def of(
        cls, estimator: Estimator, recording: Recording, actuator: Actuator, seed: int, *, alone: bool
    ) -> Self:
        """Return what the estimator makes of the recording, or raise as `diagnose_by` does.

        Whether the answer will do, and whether a channel comes a row late, is asked where no search follows,
        `alone`: a search tests for both itself.
        """
        check_recording(recording)
        check_actuator(actuator)
        check_plausible(recording, actuator)
        recording = with_equivalent_current(recording, actuator)
        estimator.check(recording, actuator)
        objective = _objective(estimator, recording, actuator)
        rows = in_time_and_moved(estimator, recording) if alone else estimator.rows(recording)
        answers = estimator.answers(rows, objective.problem.inputs)
        mixture = answers[0]
        unlike = _elsewhere(estimator, recording, actuator, objective.problem)
        if not unlike.reasons:
            rng = stream(seed, "likeness of the recording")
            compared = Comparison.of(estimator.setup, objective.problem.inputs, rows, answers, rng)
            unlike = unlikeness(estimator, compared[:1])
            if alone and not (unlike.reasons or unlike.rare):
                delay = found_delay(estimator, compared)
                if delay is not None:
                    unlike = Unlikeness(_not_in_time(delay, mixture, objective, seed))
        if unlike.reasons:
            return cls(recording, mixture, None, (*unlike.rare, *unlike.reasons))
        answer = _Answer.of(mixture, objective, seed, len(rows), alone=alone)
        return cls(recording, mixture, answer, (*unlike.rare, *answer.reasons))


def _not_in_time(delay: str, mixture: Mixture, objective: MapObjective, seed: int) -> tuple[str, ...]:
    """Return why an answer is not believed where another time leaves less, as the clause `delay` says.

    Where the answer explains nothing in time, answers for other times leave less by chance: no delay is
    named then, but what is left.
    """
    result = SearchResult.at(objective, objective.space.project(mixture.mean))
    return _left_unexplained(result, seed, moves=moves_at(objective, result.point)) or (delay,)


def _elsewhere(
    estimator: Estimator, recording: Recording, actuator: Actuator, problem: Problem
) -> Unlikeness:
    """Return what speaks against any answer: a sensor's own signal, or another start."""
    findings = check_sensors(recording, actuator).findings
    if findings:
        return Unlikeness(tuple(finding.sentence.removesuffix(".") for finding in findings))
    if not estimator.setup.starts_there(problem.start):
        where = f"{estimator.setup.initial_position:g}"
        return Unlikeness(
            (f"it starts elsewhere, or after a motion; the training's manoeuvre starts at rest at {where}",)
        )
    return Unlikeness(())
