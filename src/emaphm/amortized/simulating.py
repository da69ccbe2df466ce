"""The training set: draws of the prior, each simulated once, stored in shards as these finish.

Shards hold the sensors' signals before noise and rounding of the converters. Noise is drawn anew each time a
shard is used (`noise_rms`), so that one simulation serves with many noises. Rows are averaged in blocks to at
most `MOST_KEPT_ROWS` per channel. A shard depends on the setup, its number and the seed, not on the number of
shards: a larger training set of the same setup continues a smaller one.
"""

import io
import json
import zipfile
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from emaphm.actuator import Actuator, Command
from emaphm.actuator.lumped_parameters import lumped_parameters
from emaphm.amortized.drawing import PRIOR, draw
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.arrays import Array, Single
from emaphm.diagnosis.deciding_code import NOT_DECIDING
from emaphm.errors import ExecutionError
from emaphm.estimation.sensors.sensor_model import all_as_described
from emaphm.execution import Task, outcomes
from emaphm.execution.folder import WorkFolder
from emaphm.execution.revision import revision_of
from emaphm.output_files import written_whole
from emaphm.random_streams import stream
from emaphm.simulation import REFERENCE, Inputs, Model, Plant, observe_batch

SHARD_DRAWS = 1024
"""Draws in a shard: 7 s of the reference model in the base setting, so that an interruption costs little."""

MOST_KEPT_ROWS = 1250
"""Largest number of rows of a channel that a network reads: 2.5 kHz in the base setting, where the interval
between commutations has six rows at top speed."""

SETTINGS = "training.json"

DECIDING = (
    "actuator",
    "simulation",
    "estimation/space",
    "estimation/sensors",
    "amortized/drawing.py",
    "amortized/recording_setup.py",
    "amortized/simulating.py",
    "arrays.py",
    "random_streams.py",
)
"""The sub-packages and files whose code decides the content of a shard."""


@dataclass(frozen=True, eq=False)
class TrainingSet:
    """Points (n, d) and noise-free rows in blocks (n, channels, blocks), single precision."""

    points: Single
    rows: Single

    def __len__(self) -> int:
        """Return the number of draws."""
        return len(self.points)

    def __getitem__(self, part: slice) -> "TrainingSet":
        """Return the draws of the slice `part`."""
        return TrainingSet(self.points[part], self.rows[part])


def block_of(samples: int) -> int:
    """Return the number of rows in a block, which are averaged, for a recording of `samples` rows."""
    return max(1, -(-samples // MOST_KEPT_ROWS))


def in_blocks(rows: Array | Single, block: int) -> Single:
    """Return the means of rows (…, samples) over complete blocks, (…, samples // block)."""
    blocks = rows.shape[-1] // block
    # A reduction over an axis as short as a block would take NumPy ten times as long.
    total = sum(rows[..., i : blocks * block : block] for i in range(block))
    return np.asarray(total / block, np.float32)


def noise_rms(setup: RecordingSetup) -> Single:
    """Return the rms noise (channels,) of a block mean: white noise and rounding by the converters.

    A converter of step q adds q²/12 to the variance of a row (Widrow 1956). Its errors are independent from
    row to row if the signal crosses several steps between rows or has noise of half a step.
    """
    white, steps = setup.noise_of, setup.resolution_of
    variances = [white[name] ** 2 + steps[name] ** 2 / 12 for name in setup.channels]
    return np.sqrt(np.array(variances) / block_of(setup.samples)).astype(np.float32)


def simulated(
    setup: RecordingSetup,
    inputs: Inputs,
    model: Model,
    points: Array,
    *,
    actuator: Actuator | None = None,
    inertia: Array | None = None,
) -> Single:
    """Return the noise-free block means (n, channels, blocks) at `points` (n, d), simulated on one thread.

    They are of the setup's actuator, or of another `actuator` with the same coordinates. `inertia` (n,) is a
    relative change of the inertia.
    """
    space = setup.space
    lumped = space.nuisances.lumped_parameters(setup.actuator, space.nuisance_values(points))
    if inertia is not None:
        described = lumped_parameters(setup.actuator, ("inertia",))["inertia"]
        lumped["inertia"] = lumped.get("inertia", described) * (1 + inertia)
    plant = Plant.of(actuator or setup.actuator, space.faults(points), lumped)
    exact = observe_batch(model, plant, inputs, setup.start, channels=setup.channels, workers=1)
    shown = all_as_described(exact, setup.channels, setup.actuator, setup.interval_s)
    return in_blocks(shown, block_of(setup.samples))


def shard(setup: RecordingSetup, command: Command, seed: int, number: int) -> tuple[Single, Single]:
    """Return points (n, d) and rows (n, channels, blocks) of one shard; the task of a worker."""
    points = draw(setup.space, SHARD_DRAWS, stream(seed, "training draws", number))
    inputs = setup.inputs(command, REFERENCE.step_for(setup.actuator))
    return points.astype(np.float32), simulated(setup, inputs, REFERENCE, points)


def simulate_shards(
    setup: RecordingSetup,
    command: Command,
    count: int,
    folder: WorkFolder,
    *,
    seed: int = 0,
    workers: int | None = None,
    scheduler: str | None = None,
    on_shard: Callable[[int, int], None] | None = None,
) -> None:
    """Simulate those of the first `count` shards that `folder` lacks; the caller holds the folder's lock.

    Raises
    ------
    ExecutionError
        A worker died, or a simulation failed.
    OutputError
        A shard cannot be written, for example because the disk is full; finished shards are kept.
    """
    missing = [number for number in range(count) if read_shard(_path(folder, number)) is None]
    tasks = [
        Task(number, shard, (setup, command, seed, number), name=f"shard {number}") for number in missing
    ]
    done = count - len(missing)
    if on_shard:
        on_shard(done, count)
    with closing(outcomes(tasks, workers=workers, scheduler=scheduler)) as finished:
        for outcome in finished:
            if outcome.failure:
                raise ExecutionError(f"{outcome.failure}; the other shards are kept in {folder.path}")
            points, rows = outcome.result
            buffer = io.BytesIO()
            np.savez(buffer, points=points, rows=rows)
            with written_whole(_path(folder, outcome.index)) as temporary:
                temporary.write_bytes(buffer.getvalue())
            done += 1
            if on_shard:
                on_shard(done, count)


def read_shards(folder: WorkFolder, numbers: Sequence[int]) -> TrainingSet:
    """Return the draws of the shards `numbers`, which `simulate_shards` has stored."""
    points: list[Single] = []
    rows = np.zeros((0, 0, 0), np.float32)
    for i, number in enumerate(numbers):
        held = read_shard(_path(folder, number))
        if held is None:
            raise ExecutionError(
                f"{folder.path}: a shard is gone or damaged; start again to have it made again"
            )
        if i == 0:
            # Allocated once: a list of all shards and its concatenation would take twice the memory.
            rows = np.empty((len(numbers) * len(held[1]), *held[1].shape[1:]), np.float32)
        points.append(held[0])
        rows[i * len(held[1]) : (i + 1) * len(held[1])] = held[1]
    return TrainingSet(np.concatenate(points), rows)


def training_folder(path: Path, setup: RecordingSetup, seed: int) -> WorkFolder:
    """Return the folder of a training set at `path`: a new one, or one of the same setup and code.

    Raises
    ------
    ExecutionError
        The folder holds the training set of another setup or version, or other files.
    """
    folder = _work_folder(path)
    here = {
        "revision": revision(),
        "setup": setup.identity(),
        "seed": seed,
        "prior": asdict(PRIOR),
    }
    differing = folder.begin_or_resume(json.dumps(here, indent=1), elsewhere="another --folder")
    if differing:
        raise ExecutionError(
            f"{path} holds the training set of another setup: {differing}; give another --folder, or remove "
            "it"
        )
    return folder


def revision() -> str:
    """Return a fingerprint of the code and libraries that decide the content of a shard."""
    return revision_of(DECIDING, NOT_DECIDING)


def remove_training_folder(path: Path) -> None:
    """Remove a training set, unless another process uses it."""
    _work_folder(path).remove()


def _work_folder(path: Path) -> WorkFolder:
    return WorkFolder(path, SETTINGS, "training of an estimator", ExecutionError)


def read_shard(path: Path) -> tuple[Single, Single] | None:
    """Return points and rows of the shard at `path`; None if it is absent or damaged."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as held:
            return held["points"], held["rows"]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None


def _path(folder: WorkFolder, number: int) -> Path:
    return folder.path / f"shard-{number:05}.npz"
