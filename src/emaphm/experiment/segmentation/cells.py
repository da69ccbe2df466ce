"""Cells of a recording: where the command moves the actuator, and what each cell will tell of the faults."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from emaphm.actuator import Actuator
from emaphm.actuator.faults import HEALTHY
from emaphm.arrays import Array, runs
from emaphm.estimation.finite_differences import replicated_jacobians
from emaphm.estimation.objective import MapObjective, faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.signal_size import signal_size
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.estimation.uncertainty.local_covariance import JACOBIAN_STEP
from emaphm.experiment.segmentation.healthy_motion import healthy_position
from emaphm.random_streams import stream
from emaphm.recording import Recording, with_equivalent_current
from emaphm.recording.checks import FEWEST_SAMPLES
from emaphm.recording.noise import measured_noise, robust_noise_level


@dataclass(frozen=True)
class CellSettings:
    """How a recording is divided, and what is computed of a cell.

    A cell takes some `cell_s` [s], so that a recording is a whole number of them, and some `fewest_rows` at
    least. A rest lasts `rest_s` [s] or longer: in that time the command moves the motor by no more than its
    backlash, or than the command's own noise, and the healthy actuator moves by no more than its backlash, or
    than `least_motion` of the command's range, as it settles. No noise above that share is allowed for: an
    undersampled command looks like noise. Jacobians are taken over at most `block_s` [s] at once,
    `replicates` of them: products of different ones are free of the bias of their errors, which slow motion
    with stick-slip makes large. A residual is expected to be as large as the channel's noise, and
    `model_error` of its rms (`search_result.SMALLEST_SHARE`), and to be correlated over `correlated_s` [s]:
    half-widths are then 1 to 3 times those of a diagnosis, of chirps of the thesis's actuator at 5 kHz and at
    100 Hz (`emaphm segment`, `emaphm diagnose`).
    """

    cell_s: float = 0.25
    fewest_rows: int = 4
    rest_s: float = 1.0
    least_motion: float = 1e-3
    block_s: float = 20.0
    replicates: int = 6
    model_error: float = 5e-3
    correlated_s: float = 5e-4


CELLS = CellSettings()

NOISE_ORDER = 4
"""Of the differences that show the noise of a command: of lower order, one that seldom flickers has none."""


@dataclass(frozen=True, eq=False)
class Cells:
    """The first row of each cell, and the row after the last one, in `edges` (cells + 1,); which cells move.

    Every row is in a cell, and cells differ by one row at most. `moves` is (cells,); `least` is the largest
    change of a command at rest, at the user [rad].
    """

    edges: NDArray[np.intp]
    moves: NDArray[np.bool_]
    least: float

    @property
    def rows(self) -> int:
        """Rows of the shortest cell."""
        return int(np.diff(self.edges).min())

    @classmethod
    def of(cls, recording: Recording, actuator: Actuator) -> "Cells":
        """Return the cells of a recording."""
        usual = max(CELLS.fewest_rows, round(CELLS.cell_s * recording.sample_rate_hz))
        count = max(1, round(recording.samples / usual))
        edges = np.arange(count + 1) * recording.samples // count
        command, position = recording["command_rad"], healthy_position(recording, actuator)
        gap = abs(actuator.mechanics.backlash * actuator.mechanics.gear_ratio)
        settled = CELLS.least_motion * float(np.ptp(command))
        least = max(gap, min(_noise_range(command), settled))
        together = min(count, max(1, round(CELLS.rest_s * count / recording.duration_s)))
        still = _ranges(command, edges, together) <= least
        still &= _ranges(position, edges, together) <= max(gap, settled)
        moves = np.ones(count, bool)
        for i in range(together):
            moves &= ~still[i : i + count]
        return cls(edges, moves, least)

    def blocks(self, interval: float) -> Iterator[tuple[int, int]]:
        """Yield first and last cell (exclusive) of each run of moving cells, of at most `block_s`.

        A short one takes cells at rest in addition, until it has the rows that a recording needs.
        """
        fewest = min(-(-FEWEST_SAMPLES // self.rows), self.moves.size)
        longest = int(np.diff(self.edges).max())
        most = max(1, int(CELLS.block_s / (longest * interval)))
        for first, last in runs(self.moves):
            for start in range(first, last, most):
                stop = min(start + most, last)
                begin = min(start, max(self.moves.size - fewest, 0))
                yield begin, max(stop, begin + fewest)


def _ranges(signal: Array, edges: NDArray[np.intp], together: int) -> Array:
    """Return the range of a signal (samples,) over each run of cells `together`, (cells + together - 1,).

    With the row before a run and the one after it: a step between two cells belongs to both. The first runs
    begin before the recording and the last end behind it: what rests there is taken to rest on.
    """
    reaching = [signal[max(first - 1, 0) : last + 1] for first, last in pairwise(edges)]
    none = [(np.inf, -np.inf)] * (together - 1)
    lowest, highest = np.array([*none, *((cell.min(), cell.max()) for cell in reaching), *none]).T
    over = sliding_window_view(highest, together).max(axis=1)
    return np.asarray(over - sliding_window_view(lowest, together).min(axis=1))


def _noise_range(command: Array) -> float:
    """Return the range that normal noise as that of the command (n,) keeps to."""
    return 2 * math.sqrt(2 * math.log(command.size)) * robust_noise_level(command, NOISE_ORDER)


def cell_information(
    objective: MapObjective, edges: NDArray[np.intp], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return the information (cells, d, d) of each cell of an objective's problem, at the healthy actuator.

    `edges` (cells + 1,) are the cells' first rows, and the row after the last one.
    Mean products of different replicated Jacobians, over the variance that `expected_objective` weights by,
    and over the rows that a residual is correlated over.
    """
    space = objective.space
    jacobians = replicated_jacobians(
        lambda points: objective.outputs(points)[:, : objective.channel_rows],
        space.points(HEALTHY.vector),
        space,
        JACOBIAN_STEP,
        CELLS.replicates,
        rng,
    )
    n, d = jacobians.shape[:2]
    by_channel = jacobians.reshape(n, d, len(objective.problem.channels), -1)
    products = np.array([_different_products(by_channel[..., a:b]) for a, b in pairwise(edges)])
    variance = objective.residual_rms**2
    correlated = max(1.0, CELLS.correlated_s / objective.problem.inputs.interval)
    return np.asarray(products / (n * (n - 1) * variance * correlated))


def _different_products(jacobians: Array) -> Array:
    """Return the sum of the products (d, d) of any two different Jacobians (n, d, channels, rows)."""
    total = jacobians.sum(axis=0)
    alike = np.einsum("ndcr,necr->de", jacobians, jacobians)
    return np.asarray(np.einsum("dcr,ecr->de", total, total) - alike)


def expected_objective(
    recording: Recording, actuator: Actuator, sizes: dict[str, float], workers: int | None
) -> MapObjective:
    """Return what a diagnosis would minimise on a stretch, residuals weighted by their expected `sizes`."""
    problem = problem_of(recording, actuator, workers=workers, channels=None)
    kept = tuple(name for name in problem.channels if sizes.get(name, 0.0) > 0)
    expected = [sizes[name] for name in kept]
    weighted = problem.observing(kept).weighted(expected)
    return faults_objective(weighted, None).scale_prior(expected[0])


def expected_residuals(recording: Recording) -> dict[str, float]:
    """Return the size of the residual that is expected of each channel, in its unit."""
    interval = recording.interval_s
    return {
        name: math.hypot(measured_noise(values, interval), CELLS.model_error * signal_size(name, values))
        for name, values in recording.channels.items()
        if name not in ("time_s", "command_rad")
    }


def block_information(
    recording: Recording, actuator: Actuator, cells: Cells, seed: int, workers: int | None
) -> Iterator[tuple[int, Array, ParameterSpace]]:
    """Yield first cell, information (cells, d, d) and parameter space of each block that moves."""
    recording = with_equivalent_current(recording, actuator)
    command = recording["command_rad"]
    sizes = expected_residuals(recording)
    for first, last in cells.blocks(recording.interval_s):
        begin, end = int(cells.edges[first]), int(cells.edges[last])
        if np.ptp(command[begin:end]) == 0:
            continue  # The end of a slow motion: a model that starts on the command rests.
        part = stretch(recording, begin, end)
        objective = expected_objective(part, actuator, sizes, workers)
        edges = cells.edges[first : last + 1] - begin
        rng = stream(seed, "Jacobians of a block", first)
        yield first, cell_information(objective, edges, rng), objective.space


def stretch(recording: Recording, first: int, last: int) -> Recording:
    """Return the rows from `first` to `last` (exclusive) as a recording."""
    return recording.with_channels({name: values[first:last] for name, values in recording.channels.items()})
