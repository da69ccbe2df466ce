"""A load that steps during the recording: applied by a rig, or a gust.

A spline in time cannot represent steps, and descents do not find their instants from a distance. A linear
model is therefore scanned over the instants; a search starts there, with sizes and times free like faults.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import chain, combinations
from typing import Self

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.diagnosis.selection.extension import with_nuisances
from emaphm.diagnosis.selection.linear_model import LinearModel
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.nuisances import PRIORS_PER_UNIT, Located
from emaphm.simulation.laws.load_steps import step_names


@dataclass(frozen=True)
class LoadStepSettings:
    """How up to `most` steps of a load are located.

    A first scan has `instants` over the recording without a share of `ends` at both ends; further scans have
    `finer` instants about the best until their spacing is `near` [s]: from 8 ms away, at the chirp of 0.5 s,
    a search ended within 0.1 ms of the instant. A rise time is searched for about `rise` [s]: values of 0 to
    40 ms were found within 5 ms. At the ends a step resembles other effects, such as an unknown start.
    """

    most: int = 2
    ends: float = 0.05
    instants: int = 64
    finer: int = 16
    near: float = 0.01
    rise: float = 0.01


STEPS = LoadStepSettings()

SIZE = 0.05
"""Coordinate of a step's size for a derivative: a quarter of a standard deviation of its prior."""

AT_ONCE = 16
"""Number of instants that are simulated in one batch."""

SINGULAR = 1e-9
"""Regularisation relative to the columns' sum of squares: a step after the last row has no effect."""


def with_steps(
    searched: SearchResult, others: tuple[str, ...], model: LinearModel
) -> list[tuple[MapObjective, float]]:
    """Return objectives with the nuisances `others` and a load of one step, of two, and so on.

    The steps are located where the residual is smallest by the linear `model`, which includes `others`. Each
    objective has the share of the residual beyond noise that remains.
    """
    scan, objectives = _Scan.of(searched, model), []
    for count in range(1, STEPS.most + 1):
        instants, share = scan.best(count)
        names_of_steps = [step_names(i) for i in range(1, count + 1)]
        located = dict[str, Located]()
        for (_, time, rise), instant in zip(names_of_steps, instants, strict=True):
            located[time] = Located(float(instant), STEPS.near)
            located[rise] = Located(STEPS.rise, STEPS.rise)
        objective, _ = with_nuisances(searched, (), (*others, *chain(*names_of_steps)), 1.0, located)
        objectives.append((objective, share))
    return objectives


@dataclass(frozen=True, eq=False)
class _Scan:
    """Effects of a load step on the current that the linear `model` does not contain, by its instant.

    `objective` has one step, and `point` (d,) is the estimate in its space.
    """

    objective: MapObjective
    point: Array
    model: LinearModel

    @classmethod
    def of(cls, searched: SearchResult, model: LinearModel) -> Self:
        """Return the scan for the estimate `searched` without load steps."""
        half, (_, time, rise) = searched.objective.problem.inputs.duration / 2, step_names(1)
        middle = {time: Located(half, half), rise: Located(0.0, STEPS.rise)}
        return cls(*with_nuisances(searched, (), step_names(1), 1.0, middle), model)

    def best(self, count: int) -> tuple[Array, float]:
        """Return the `count` instants (count,) [s] of the smallest residual, and its share beyond noise."""
        instants, columns = self._first_scan
        first, last = instants[[0, -1]]
        spacing = float(instants[1] - instants[0])
        sets = np.array(list(combinations(range(STEPS.instants), count)))
        indices, remaining = best_set(self.model.residual, columns, sets)
        best = instants[indices]
        while spacing > STEPS.near:
            finer = np.linspace(-spacing, spacing, STEPS.finer)
            for i in range(count):
                fixed = np.delete(best, i)
                candidates = np.append(fixed, np.clip(best[i] + finer, first, last))
                sets = np.array([[*range(count - 1), count - 1 + k] for k in range(STEPS.finer)])
                indices, remaining = best_set(self.model.residual, self._effects(candidates), sets)
                best = candidates[indices]
            spacing = float(finer[1] - finer[0])
        return np.sort(best), self.model.share_of(remaining)

    @cached_property
    def _first_scan(self) -> tuple[Array, Array]:
        """The instants of the first scan, and their effects."""
        first, last = np.array([STEPS.ends, 1 - STEPS.ends]) * self.objective.problem.inputs.duration
        instants = np.linspace(first, last, STEPS.instants)
        return instants, self._effects(instants)

    def _effects(self, instants: Array) -> Array:
        """Return the effects (n, samples) of steps at `instants` (n,), orthogonal to other parameters."""
        space, samples = self.objective.space, self.model.residual.size
        size, time, _ = (space.coordinates.index(name) for name in step_names(1))
        middle = space.nuisances.located[space.coordinates[time]]
        points = np.tile(self.point, (len(instants), 1))
        points[:, time] = (instants - middle.value) / (PRIORS_PER_UNIT * middle.deviation)
        columns = np.empty((len(instants), samples))
        for first in range(0, len(instants), AT_ONCE):
            batch = slice(first, first + AT_ONCE)
            up, down = points[batch].copy(), points[batch].copy()
            up[:, size], down[:, size] = SIZE, -SIZE
            columns[batch] = (self.objective.outputs(up) - self.objective.outputs(down))[:, :samples]
        return self.model.without(columns)


def best_set(residual: Array, columns: Array, sets: NDArray[np.intp]) -> tuple[NDArray[np.intp], float]:
    """Return the set of `columns` (n, samples) with the smallest `residual` (samples,), and its mean square.

    `sets` (m, count) contain indices of columns.
    """
    products, projections = columns @ columns.T, columns @ residual
    # While friction holds the actuator, no load has an effect: every size fits equally well, and 0 is taken.
    products += (SINGULAR * float(np.trace(products)) or 1.0) * np.eye(len(columns))
    of_sets = products[sets[:, :, np.newaxis], sets[:, np.newaxis, :]]
    sizes = np.linalg.solve(of_sets, projections[sets][..., np.newaxis])[..., 0]
    reductions = np.sum(projections[sets] * sizes, axis=1)
    best = int(reductions.argmax())
    return sets[best], float((residual @ residual - reductions[best]) / residual.size)
