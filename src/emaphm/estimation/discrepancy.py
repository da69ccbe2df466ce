"""Discrepancy: difference of the outputs of the reference model and of the fitted model at a point.

The two models are compared only here. The reference model's switching is chaotic: two runs with practically
equal parameters have different ripple. The discrepancy is therefore the mean over several runs about each
point, with a standard error. If a channel has visible counts, the runs are rounded to them: the discrepancy
then includes the error of the converter.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.problem import Problem
from emaphm.estimation.sensors.counts import in_counts
from emaphm.recording.noise import noise_level
from emaphm.simulation import REFERENCE

REFERENCE_RUNS = 16
"""Runs of the reference model in a comparison, shared by its points: its kernel advances 16 runs at once."""

RUN_SEPARATION = 1e-5
"""Standard deviation of the runs about a point, in coordinates: only the switching differs."""

BAND_SPREAD = 0.02
"""Relative spread of the hysteresis between runs whose ripple must have all phases."""

LONGEST_S = 60.0
"""Longest recording that is compared [s]: the reference model's steps of longer ones need more than 1 GB."""


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """The reference model's outputs minus the fitted model's outputs at a point.

    `mean` and `standard_error`, (rows,), come from several `runs` and have the weights of the objective's
    outputs. `switching_variance` is the variance of the primary channel in one run due to chaotic switching,
    in the square of its unit; `channel_variances`, (channels,), are the switching variances of all channels,
    each in the square of its own unit. `slow_variance` is the part of `switching_variance` that is too slow
    to count as noise; it is 0 (unknown) if the runs may have the same phase of switching.
    """

    mean: Array
    standard_error: Array
    switching_variance: float
    runs: int
    channel_variances: Array = field(default_factory=lambda: np.zeros(0))
    slow_variance: float = 0.0

    def rescaled(self, objective: MapObjective, before: MapObjective) -> "Discrepancy":
        """Return the discrepancy with the weights of `objective`; it has the weights of `before`."""
        return Discrepancy(
            objective.rescaled(self.mean, before),
            objective.rescaled(self.standard_error, before),
            self.switching_variance,
            self.runs,
            self.channel_variances,
            self.slow_variance,
        )


def has_reference(problem: Problem) -> bool:
    """Return whether the reference model can run: it has the drive, and the recording is not too long."""
    return problem.actuator.drive_kind in REFERENCE.forms and problem.duration_s <= LONGEST_S


def resolves_switching(problem: Problem) -> bool:
    """Return whether the reference model can run and simulates switching, unlike the averaged model.

    For a drive without switching, the reference model only has a shorter step and is not more realistic.
    """
    return has_reference(problem) and problem.actuator.three_phases


def with_all_phases(reference: Problem) -> Problem:
    """Return the problem of the reference model with a different hysteresis band in each run.

    In a slow and steady motion the switching is periodic: it keeps its initial phase, so runs with nearly
    equal parameters keep the same phase. Their mean then contains a ripple, which has another phase in the
    recording, and their variance does not contain it. Runs with different bands have different periods, and
    their phases diverge within some tens of periods.
    """
    return replace(reference, band_spread=BAND_SPREAD)


def discrepancies(
    objective: MapObjective,
    points: Array,
    outputs: Array,
    reference: Problem,
    rng: np.random.Generator,
) -> list[Discrepancy]:
    """Return the discrepancy at each of `points` (n, d), whose `outputs` (n, rows) are known.

    `reference` is the problem of the reference model, from `reference_problem`; `rng` draws the separations
    of its runs.
    """
    n, repeats = len(points), REFERENCE_RUNS // len(points)
    runs = runs_about(objective, points, reference, rng, repeats)
    variance = runs.var(axis=1, ddof=1)
    samples, weights = objective.problem.samples, objective.problem.weights
    by_channel = variance[:, : objective.channel_rows].reshape(n, weights.size, samples).mean(axis=2)
    return [
        Discrepancy(
            runs[i].mean(axis=0) - outputs[i],
            (variance[i] / repeats) ** 0.5,
            float(variance[i, :samples].mean()),
            repeats,
            by_channel[i] / weights**2,
            _slow_variance(runs[i, :, :samples]) if reference.band_spread else 0.0,
        )
        for i in range(n)
    ]


def runs_about(
    objective: MapObjective, points: Array, reference: Problem, rng: np.random.Generator, repeats: int
) -> Array:
    """Return the outputs (n, repeats, rows) of several runs of the `reference` model about `points` (n, d).

    They are weighted and rounded as the objective's channels are.
    """
    n, d = points.shape
    separation = rng.normal(0.0, RUN_SEPARATION, (n, repeats, d))
    near = objective.space.project(points[:, np.newaxis] + separation).reshape(-1, d)
    weighted = replace(objective, problem=reference.like(objective.problem))
    return _rounded(weighted.outputs(near), objective.problem).reshape(n, repeats, -1)


def _slow_variance(runs: Array) -> float:
    """Return the part of the variance between `runs` (n, samples) that is too slow to count as noise."""
    ripple = runs - runs.mean(axis=0)
    fast = float(np.mean([noise_level(run) ** 2 for run in ripple]))
    unbiased = len(runs) / (len(runs) - 1)
    return max(unbiased * (float(np.mean(ripple**2)) - fast), 0.0)


def _rounded(outputs: Array, problem: Problem) -> Array:
    """Return weighted `outputs` (n, rows); channels with visible counts are rounded to them in place."""
    samples = problem.samples
    for i, (name, weight) in enumerate(zip(problem.channels, problem.weights, strict=True)):
        if name in problem.counts:
            rows = outputs[:, i * samples : (i + 1) * samples]
            rows[:] = in_counts(rows, weight * problem.measured[name], weight * problem.counts[name])
    return outputs


def reference_problem(objective: MapObjective) -> Problem:
    """Return the objective's problem for the reference model; reuse it, its inputs have a million steps.

    If the shaft comes to rest, motion is slow, and the runs have all phases (`with_all_phases`).
    """
    reference = objective.problem.by(REFERENCE)
    return reference if objective.problem.rests is None else with_all_phases(reference)
