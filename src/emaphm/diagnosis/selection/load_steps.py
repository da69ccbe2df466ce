"""A load that steps while the actuator is recorded, which nobody named: what a rig puts on, or a gust.

A spline in time cannot follow it, and no descent finds from afar when it steps. So a linear model is scanned
for the instants, and a search goes on from there, with sizes and times as unknown as the faults.
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
    """How a load's steps are located; up to `most` of them.

    A run, less a share of `ends` at either end, has `instants` in a first scan, and `finer` ones between
    those next to the best until they are `near` [s]: from 8 ms off, at the chirp of 0.5 s, a search ended
    within 0.1 ms of the instant. A rise is searched for about `rise` [s]: from none to 40 ms it was found
    within 5 ms. At the ends a step is like much else: how a run starts is not known.
    """

    most: int = 2
    ends: float = 0.05
    instants: int = 64
    finer: int = 16
    near: float = 0.01
    rise: float = 0.01


STEPS = LoadStepSettings()

SIZE = 0.05
"""Of the coordinate of a step's size, for a derivative: a quarter of a standard deviation of its prior."""

AT_ONCE = 16
"""Instants whose runs are held at once."""

SINGULAR = 1e-9
"""Of the columns' sum of squares, added to each: a step after the last row does nothing."""


def with_steps(
    searched: SearchResult, others: tuple[str, ...], model: LinearModel
) -> list[tuple[MapObjective, float]]:
    """Return objectives with `others` nuisances and a load of one step, of two, and so on.

    Each step is located where, with what the linear `model` has of `others`, it leaves least of the residual.
    With the share that is left beyond noise.
    """
    scan, found = _Scan.of(searched, model), []
    for count in range(1, STEPS.most + 1):
        instants, share = scan.best(count)
        each = [step_names(i) for i in range(1, count + 1)]
        located = dict[str, Located]()
        for (_, time, rise), instant in zip(each, instants, strict=True):
            located[time] = Located(float(instant), STEPS.near)
            located[rise] = Located(STEPS.rise, STEPS.rise)
        objective, _ = with_nuisances(searched, (), (*others, *chain(*each)), 1.0, located)
        found.append((objective, share))
    return found


@dataclass(frozen=True, eq=False)
class _Scan:
    """What of the current's residual a load does that steps at an instant, and a linear `model` does not.

    `objective` has one step, and `point` (d,) is the estimate in its space.
    """

    objective: MapObjective
    point: Array
    model: LinearModel

    @classmethod
    def of(cls, searched: SearchResult, model: LinearModel) -> Self:
        """Return the scan for the estimate that was `searched` without a load that steps."""
        half, (_, time, rise) = searched.objective.problem.inputs.duration / 2, step_names(1)
        middle = {time: Located(half, half), rise: Located(0.0, STEPS.rise)}
        return cls(*with_nuisances(searched, (), step_names(1), 1.0, middle), model)

    def best(self, count: int) -> tuple[Array, float]:
        """Return the `count` instants (count,) [s] that leave least, and the share left beyond noise."""
        instants, columns = self._even
        first, last = instants[[0, -1]]
        spacing = float(instants[1] - instants[0])
        sets = np.array(list(combinations(range(STEPS.instants), count)))
        places, mean_square = best_set(self.model.residual, columns, sets)
        best = instants[places]
        while spacing > STEPS.near:
            finer = np.linspace(-spacing, spacing, STEPS.finer)
            for i in range(count):
                held = np.delete(best, i)
                near = np.append(held, np.clip(best[i] + finer, first, last))
                sets = np.array([[*range(count - 1), count - 1 + k] for k in range(STEPS.finer)])
                places, mean_square = best_set(self.model.residual, self._columns(near), sets)
                best = near[places]
            spacing = float(finer[1] - finer[0])
        return np.sort(best), self.model.share_of(mean_square)

    @cached_property
    def _even(self) -> tuple[Array, Array]:
        """The instants of the first scan, and their columns."""
        first, last = np.array([STEPS.ends, 1 - STEPS.ends]) * self.objective.problem.inputs.duration
        instants = np.linspace(first, last, STEPS.instants)
        return instants, self._columns(instants)

    def _columns(self, instants: Array) -> Array:
        """Return what a step at each of `instants` (n,) does and no parameter can, (n, samples)."""
        space, samples = self.objective.space, self.model.residual.size
        size, time, _ = (space.coordinates.index(name) for name in step_names(1))
        middle = space.nuisances.located[space.coordinates[time]]
        points = np.tile(self.point, (len(instants), 1))
        points[:, time] = (instants - middle.value) / (PRIORS_PER_UNIT * middle.deviation)
        columns = np.empty((len(instants), samples))
        for first in range(0, len(instants), AT_ONCE):
            some = slice(first, first + AT_ONCE)
            up, down = points[some].copy(), points[some].copy()
            up[:, size], down[:, size] = SIZE, -SIZE
            columns[some] = (self.objective.outputs(up) - self.objective.outputs(down))[:, :samples]
        return self.model.without(columns)


def best_set(residual: Array, columns: Array, sets: NDArray[np.intp]) -> tuple[NDArray[np.intp], float]:
    """Return the set of `columns` (n, samples) that leaves least of a `residual` (samples,), and how much.

    How much is a mean square; `sets` (m, count) are places among the columns.
    """
    products, along = columns @ columns.T, columns @ residual
    # Where friction holds the actuator no load does anything: every size is as right, and 0 is taken.
    products += (SINGULAR * float(np.trace(products)) or 1.0) * np.eye(len(columns))
    of_sets = products[sets[:, :, np.newaxis], sets[:, np.newaxis, :]]
    sizes = np.linalg.solve(of_sets, along[sets][..., np.newaxis])[..., 0]
    gained = np.sum(along[sets] * sizes, axis=1)
    best = int(gained.argmax())
    return sets[best], float((residual @ residual - gained[best]) / residual.size)
