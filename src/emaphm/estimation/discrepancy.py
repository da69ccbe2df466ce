"""What separates the fitted model from the reference model at a point: the model's discrepancy.

The only place where the two are compared. The reference model's switching is chaotic: two runs that differ by
nothing that matters have another ripple. The discrepancy is therefore the mean over several runs about each
point, with a standard error. Where a channel shows counts, the runs are rounded as it is: the discrepancy is
then of the converter too.
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
"""Runs of the reference model in a comparison, shared by its points: its kernel advances as many at once."""

RUN_SEPARATION = 1e-5
"""Standard deviation of the runs about a point, in coordinates: the switching differs, nothing else does."""

BAND_SPREAD = 0.02
"""Share by which the hysteresis of the runs differs where their ripple has to have all phases."""

LONGEST_S = 60.0
"""Recordings up to here are compared [s]: beyond, the reference model's steps would fill a gigabyte."""


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """The reference model's outputs less the fitted model's at a point.

    `mean` and `standard_error`, (rows,), are of several `runs` and weighted as the objective's outputs;
    `switching_variance` is the variance that chaotic switching makes of the primary channel in one run, in
    the square of its unit; `channel_variances`, (channels,), are those of all channels, each in the square of
    its own unit. `slow_variance` is the part of the first that does not pass for noise, 0 where the runs may
    share a phase: then it is not known.
    """

    mean: Array
    standard_error: Array
    switching_variance: float
    runs: int
    channel_variances: Array = field(default_factory=lambda: np.zeros(0))
    slow_variance: float = 0.0

    def rescaled(self, objective: MapObjective, before: MapObjective) -> "Discrepancy":
        """Return the discrepancy as `objective` weights the rows, given as `before` does."""
        return Discrepancy(
            objective.rescaled(self.mean, before),
            objective.rescaled(self.standard_error, before),
            self.switching_variance,
            self.runs,
            self.channel_variances,
            self.slow_variance,
        )


def has_reference(problem: Problem) -> bool:
    """Return whether the reference model can run: it knows the drive, the recording is not too long."""
    return problem.actuator.drive_kind in REFERENCE.forms and problem.duration_s <= LONGEST_S


def resolves_switching(problem: Problem) -> bool:
    """Return whether the reference model can run, and has switching that the averaged one has not.

    Of a drive that does not switch it has a shorter step, and is no nearer to a machine.
    """
    return has_reference(problem) and problem.actuator.three_phases


def with_all_phases(reference: Problem) -> Problem:
    """Return the problem of the reference model whose runs have each another band of hysteresis.

    On a slow and steady motion the switching is periodic: it keeps the phase that it began with, and runs
    that hardly differ share it for ever. Their mean has a ripple then, which the recording has in another
    phase, and their variance lacks it. With other bands, other periods, they part within some tens of them.
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

    `reference` is the problem of the reference model, from `reference_problem`; `rng` separates its runs.
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
    """Return outputs of the `reference` model in several runs about each of `points` (n, d).

    Their shape is (n, repeats, rows); they are weighted, and rounded, as the objective's channels are.
    """
    n, d = points.shape
    separation = rng.normal(0.0, RUN_SEPARATION, (n, repeats, d))
    near = objective.space.project(points[:, np.newaxis] + separation).reshape(-1, d)
    weighted = replace(objective, problem=reference.like(objective.problem))
    return _rounded(weighted.outputs(near), objective.problem).reshape(n, repeats, -1)


def _slow_variance(runs: Array) -> float:
    """Return the part of the variance between `runs` (n, samples) that does not pass for noise."""
    ripple = runs - runs.mean(axis=0)
    fast = float(np.mean([noise_level(one) ** 2 for one in ripple]))
    unbiased = len(runs) / (len(runs) - 1)
    return max(unbiased * (float(np.mean(ripple**2)) - fast), 0.0)


def _rounded(outputs: Array, problem: Problem) -> Array:
    """Return `outputs` (n, rows), weighted, with the channels that show counts rounded to them, in place."""
    samples = problem.samples
    for i, (name, weight) in enumerate(zip(problem.channels, problem.weights, strict=True)):
        if name in problem.counts:
            rows = outputs[:, i * samples : (i + 1) * samples]
            rows[:] = in_counts(rows, weight * problem.measured[name], weight * problem.counts[name])
    return outputs


def reference_problem(objective: MapObjective) -> Problem:
    """Return the objective's problem for the reference model; made once, it has a million steps.

    Where the shaft comes to rest, its runs have all phases (`with_all_phases`): motion is slow there.
    """
    reference = objective.problem.by(REFERENCE)
    return reference if objective.problem.rests is None else with_all_phases(reference)
