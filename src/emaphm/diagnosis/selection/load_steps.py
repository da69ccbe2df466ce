"""A load that steps while the actuator is recorded, which nobody named: what a rig puts on, or a gust.

A spline in time cannot follow it, and no descent finds from afar when it steps. So a linear model is scanned
for the instants, and a search goes on from there, with sizes and times as unknown as the faults.
"""

from dataclasses import dataclass
from itertools import chain, combinations
from typing import Self

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.diagnosis.selection.extension import with_nuisances
from emaphm.diagnosis.selection.laws.law_fit import search_with
from emaphm.errors import DivergedError
from emaphm.estimation.methods import Method
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.nuisances import PRIORS_PER_UNIT, Located
from emaphm.estimation.uncertainty.local_covariance import jacobians_of
from emaphm.random_streams import child_seed, stream
from emaphm.simulation.laws.load_steps import step_names

LOAD_STEP = "load_step"
"""What is selected where a load steps."""


@dataclass(frozen=True)
class LoadStepSettings:
    """How instants are found, and when a load that steps is searched for.

    A run has `instants` in a first scan, and a finer one between those next to the best until they are `near`
    [s]: a search from 8 ms off, at the chirp of 0.5 s, ended within 0.1 ms of the instant. Up to `most` steps
    are looked for: two are a load that is put on and taken off. One is not searched for where two leave less
    than `fewer_share` of what it does: two leave 0.5 to 0.99 of it where the load steps once, 0.03 and 0.1
    where it is put on and taken off.

    It is searched for where the linear model leaves less than `left` of the current's residual, and believed
    where noise and switching account for what it leaves.
    """

    instants: int = 64
    finer: int = 16
    near: float = 0.01
    rise: float = 0.01
    most: int = 2
    left: float = 0.8
    fewer_share: float = 0.3


STEPS = LoadStepSettings()

SIZE = 0.05
"""Of the coordinate of a step's size, for a derivative: a quarter of a standard deviation of its prior."""

AT_ONCE = 16
"""Instants whose runs are held at once."""

SINGULAR = 1e-9
"""Of the columns' sum of squares, added to each: a step after the last row does nothing."""


def with_load_steps(
    searched: SearchResult, method: Method, max_corrections: int, seed: int
) -> SearchResult | None:
    """Return the estimate with a load that steps, from that `searched` without one.

    None where it does not explain the recording. The prior of a load that varies is that of the description.
    """
    scan = _Scan.of(searched, seed)
    scanned = [scan.best(count) for count in range(1, STEPS.most + 1)]
    for count, (instants, share) in enumerate(scanned, 1):
        too_few = any(left < STEPS.fewer_share * share for _, left in scanned[count:])
        if too_few or share > STEPS.left:
            continue
        each = [step_names(i) for i in range(1, count + 1)]
        located = dict[str, Located]()
        for (_, time, rise), instant in zip(each, instants, strict=True):
            located[time] = Located(float(instant), STEPS.near)
            located[rise] = Located(STEPS.rise, STEPS.rise)
        stepping, _ = with_nuisances(searched, (), tuple(chain(*each)), 1.0, located)
        child = child_seed(seed, "search with a load that steps", count)
        try:
            found = search_with(searched, stepping, LOAD_STEP, method, max_corrections, child)
        except DivergedError:  # a load that carries the model away explains nothing
            continue
        if found.explained:
            return found
    return None


@dataclass(frozen=True, eq=False)
class _Scan:
    """What of the current's residual a load does that steps at an instant, by a linear model.

    `objective` has one step, and `point` (d,) is the estimate in its space. `known` (samples, k) are
    orthonormal columns of what the parameters of the estimate do, and `residual` (samples,) what they leave.
    """

    objective: MapObjective
    point: Array
    known: Array
    residual: Array

    @classmethod
    def of(cls, searched: SearchResult, seed: int) -> Self:
        """Return it for the estimate that was `searched` without such a load."""
        half, (_, time, rise) = searched.objective.problem.inputs.duration / 2, step_names(1)
        middle = {time: Located(half, half), rise: Located(0.0, STEPS.rise)}
        objective, point = with_nuisances(searched, (), step_names(1), 1.0, middle)
        samples = searched.objective.problem.samples
        jacobians = jacobians_of(searched, stream(seed, "Jacobians of a load that steps"))
        known, _ = np.linalg.qr(jacobians.mean(axis=0)[:, :samples].T)
        residual = searched.residual[:samples]
        return cls(objective, point, known, residual - known @ (known.T @ residual))

    def best(self, count: int) -> tuple[Array, float]:
        """Return the `count` instants (count,) [s] that leave least of the residual, and the share left."""
        duration = self.objective.problem.inputs.duration
        spacing = duration / STEPS.instants
        instants = np.asarray((np.arange(STEPS.instants) + 0.5) * spacing)
        best, share = self._least(instants, np.array(list(combinations(range(STEPS.instants), count))))
        while spacing > STEPS.near:
            finer = np.linspace(-spacing, spacing, STEPS.finer)
            for i in range(count):
                held = np.delete(best, i)
                sets = [[*range(count - 1), count - 1 + k] for k in range(STEPS.finer)]
                best, share = self._least(np.append(held, best[i] + finer), np.array(sets))
            spacing = float(finer[1] - finer[0])
        return np.sort(best), share

    def _least(self, instants: Array, sets: NDArray[np.intp]) -> tuple[Array, float]:
        """Return those of `instants` (n,) that leave least: `sets` (m, count) are their places there."""
        columns = self._columns(instants)
        products, along = columns @ columns.T, columns @ self.residual
        products += SINGULAR * float(np.trace(products)) * np.eye(len(instants))
        of_sets = products[sets[:, :, np.newaxis], sets[:, np.newaxis, :]]
        sizes = np.linalg.solve(of_sets, along[sets][..., np.newaxis])[..., 0]
        gained = np.sum(along[sets] * sizes, axis=1)
        best = int(gained.argmax())
        return instants[sets[best]], 1 - float(gained[best] / (self.residual @ self.residual))

    def _columns(self, instants: Array) -> Array:
        """Return what a step at each of `instants` (n,) does and no parameter can, (n, samples)."""
        space = self.objective.space
        size, time, _ = (space.coordinates.index(name) for name in step_names(1))
        middle = space.nuisances.located[space.coordinates[time]]
        points = np.tile(self.point, (len(instants), 1))
        points[:, time] = (instants - middle.value) / (PRIORS_PER_UNIT * middle.deviation)
        columns = np.empty((len(instants), len(self.residual)))
        for first in range(0, len(instants), AT_ONCE):
            some = slice(first, first + AT_ONCE)
            up, down = points[some].copy(), points[some].copy()
            up[:, size], down[:, size] = SIZE, -SIZE
            columns[some] = self._currents(up) - self._currents(down)
        return columns - (columns @ self.known) @ self.known.T

    def _currents(self, points: Array) -> Array:
        return self.objective.outputs(points)[:, : len(self.residual)]
