"""Cells of a recording: cells in which the command moves the actuator, and the information of each cell."""

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
    """Settings of the division of a recording into cells, and of the information of a cell.

    A cell lasts about `cell_s` [s], so that a recording is a whole number of cells, and has at least
    `fewest_rows`. A rest lasts at least `rest_s` [s]: in that time the command changes by no more than the
    backlash or the command's own noise, and the healthy actuator moves by no more than the backlash or, while
    it settles, `least_motion` of the command's range. Noise above that share is not accepted as noise,
    because an undersampled command resembles noise. Jacobians cover at most `block_s` [s], with `replicates`:
    products of different replicates are free of the bias by their errors, which are large in slow motion with
    stick-slip. The expected residual is the channel's noise plus `model_error` of its rms
    (`search_result.SMALLEST_SHARE`), correlated over `correlated_s` [s]. Half-widths are then 1 to 3 times
    those of a diagnosis, for chirps of the thesis's actuator at 5 kHz and at 100 Hz (`emaphm segment`,
    `emaphm diagnose`).
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
"""Order of the differences that measure the noise of a command; with a lower order, the measured noise of a
command that seldom flickers is 0."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Division of a recording into cells.

    `edges` (cells + 1,) are the first rows of the cells, and the row after the last cell; every row is in a
    cell, and the lengths of cells differ by at most one row. `moves` (cells,) states in which cells the
    actuator moves; `least` is the largest change of a command at rest [rad at the user].
    """

    edges: NDArray[np.intp]
    moves: NDArray[np.bool_]
    least: float

    @property
    def rows(self) -> int:
        """Number of rows of the shortest cell."""
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
        """Yield first and last cell (exclusive) of each block of moving cells, of at most `block_s`.

        A short block is extended by cells at rest to the number of rows that a recording needs.
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
    """Return the range of a signal (samples,) over each run of `together` cells, (cells + together - 1,).

    A run includes one row before and one row after it, so that a step between two cells belongs to both. The
    first runs begin before the recording and the last end after it; the signal is assumed constant there.
    """
    cells = [signal[max(first - 1, 0) : last + 1] for first, last in pairwise(edges)]
    outside = [(np.inf, -np.inf)] * (together - 1)
    lowest, highest = np.array([*outside, *((cell.min(), cell.max()) for cell in cells), *outside]).T
    largest = sliding_window_view(highest, together).max(axis=1)
    return np.asarray(largest - sliding_window_view(lowest, together).min(axis=1))


def _noise_range(command: Array) -> float:
    """Return the expected range of n samples of normal noise with the level of the command's noise."""
    return 2 * math.sqrt(2 * math.log(command.size)) * robust_noise_level(command, NOISE_ORDER)


def cell_information(
    objective: MapObjective, edges: NDArray[np.intp], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return the information (cells, d, d) of each cell of an objective's problem, at the healthy actuator.

    `edges` (cells + 1,) are the first rows of the cells, and the row after the last cell. The information is
    the mean product of different replicates of the Jacobian, divided by the variance of the weighted residual
    and by the number of rows over which a residual is correlated.
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
    """Return the sum of the products (d, d) of all pairs of different Jacobians (n, d, channels, rows)."""
    total = jacobians.sum(axis=0)
    equal_pairs = np.einsum("ndcr,necr->de", jacobians, jacobians)
    return np.asarray(np.einsum("dcr,ecr->de", total, total) - equal_pairs)


def expected_objective(
    recording: Recording, actuator: Actuator, sizes: dict[str, float], workers: int | None
) -> MapObjective:
    """Return the objective of a diagnosis on a stretch, with residuals weighted by their expected `sizes`."""
    problem = problem_of(recording, actuator, workers=workers, channels=None)
    channels_used = tuple(name for name in problem.channels if sizes.get(name, 0.0) > 0)
    expected = [sizes[name] for name in channels_used]
    weighted = problem.observing(channels_used).weighted(expected)
    return faults_objective(weighted, None).scale_prior(expected[0])


def expected_residuals(recording: Recording) -> dict[str, float]:
    """Return the expected rms residual of each channel, in its unit."""
    interval = recording.interval_s
    return {
        name: math.hypot(measured_noise(values, interval), CELLS.model_error * signal_size(name, values))
        for name, values in recording.channels.items()
        if name not in ("time_s", "command_rad")
    }


def block_information(
    recording: Recording, actuator: Actuator, cells: Cells, seed: int, workers: int | None
) -> Iterator[tuple[int, Array, ParameterSpace]]:
    """Yield first cell, information (cells, d, d) and parameter space of each block of moving cells."""
    recording = with_equivalent_current(recording, actuator)
    command = recording["command_rad"]
    sizes = expected_residuals(recording)
    for first, last in cells.blocks(recording.interval_s):
        begin, end = int(cells.edges[first]), int(cells.edges[last])
        if np.ptp(command[begin:end]) == 0:
            continue  # End of a slow motion: a model that starts at the command is at rest.
        part = stretch(recording, begin, end)
        objective = expected_objective(part, actuator, sizes, workers)
        edges = cells.edges[first : last + 1] - begin
        rng = stream(seed, "Jacobians of a block", first)
        yield first, cell_information(objective, edges, rng), objective.space


def stretch(recording: Recording, first: int, last: int) -> Recording:
    """Return the rows from `first` to `last` (exclusive) as a recording."""
    return recording.with_channels({name: values[first:last] for name, values in recording.channels.items()})
