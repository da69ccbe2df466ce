"""The training set: draws of the prior, each simulated once, in shards that are kept as they finish.

Shards hold what the sensors show before noise and converters, which are added anew whenever a shard is
learned from (`noise_rms`): a simulation serves many times, its noise once. Rows are averaged in blocks to
`MOST_KEPT_ROWS` a channel at most. A shard depends on the setup, its number and the seed, and not on how many
there are: more simulations of the same setup go on where fewer ended.
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
"""Draws of a shard: 7 s of the reference model on the base setting, so that an interruption costs little."""

MOST_KEPT_ROWS = 1250
"""Rows of a channel that a network reads: 2.5 kHz of the base setting, at which commutation has six rows at
top speed."""

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
"""The rooms and files whose code decides what a shard holds."""


@dataclass(frozen=True, eq=False)
class TrainingSet:
    """Points (n, d) and noise-free rows in blocks (n, channels, blocks), single precision."""

    points: Single
    rows: Single

    def __len__(self) -> int:
        """Return how many draws there are."""
        return len(self.points)

    def __getitem__(self, part: slice) -> "TrainingSet":
        """Return some of the draws."""
        return TrainingSet(self.points[part], self.rows[part])


def block_of(samples: int) -> int:
    """Return the rows that are averaged to one."""
    return max(1, -(-samples // MOST_KEPT_ROWS))


def in_blocks(rows: Array | Single, block: int) -> Single:
    """Return rows (…, samples) as means over blocks, (…, samples // block); what is over is left out."""
    blocks = rows.shape[-1] // block
    # A reduction over an axis as short as a block would take NumPy ten times as long.
    total = sum(rows[..., i : blocks * block : block] for i in range(block))
    return np.asarray(total / block, np.float32)


def noise_rms(setup: RecordingSetup) -> Single:
    """Return the noise of a block of each channel, rms (channels,): white noise and the converters' rounding.

    A converter of step q adds q²/12 to the variance of a row (Widrow 1956), independent from row to row where
    the signal crosses several steps between rows or has noise of half a step.
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
    """Return the noise-free rows of `points` (n, d) in blocks, (n, channels, blocks); on one thread.

    Of the setup's actuator, or of another `actuator` with the same coordinates; `inertia` (n,) is added to
    its inertia, relative to it.
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
    """Return points (n, d) and rows of one shard, on whichever worker."""
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
    """Simulate those of the first `count` shards that `folder` lacks; it is locked by the caller.

    Raises
    ------
    ExecutionError
        A worker died, or a simulation failed.
    OutputError
        The disk is full, say: what finished is kept.
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
    """Return the draws of the shards `numbers`, which `simulate_shards` has made."""
    points: list[Single] = []
    rows = np.zeros((0, 0, 0), np.float32)
    for i, number in enumerate(numbers):
        held = read_shard(_path(folder, number))
        if held is None:
            raise ExecutionError(
                f"{folder.path}: a shard is gone or damaged; start again to have it made again"
            )
        if i == 0:
            # Whole at once: a list of all shards and what is made of it would take twice the memory.
            rows = np.empty((len(numbers) * len(held[1]), *held[1].shape[1:]), np.float32)
        points.append(held[0])
        rows[i * len(held[1]) : (i + 1) * len(held[1])] = held[1]
    return TrainingSet(np.concatenate(points), rows)


def training_folder(path: Path, setup: RecordingSetup, seed: int) -> WorkFolder:
    """Return the folder of a training set at `path`, begun or of the same setup and code.

    Raises
    ------
    ExecutionError
        It holds the training set of another setup, one of another version, or something else.
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
    """Return a fingerprint of the code and libraries that decide what a shard holds."""
    return revision_of(DECIDING, NOT_DECIDING)


def remove_training_folder(path: Path) -> None:
    """Remove a training set, unless another process has begun to use it."""
    _work_folder(path).remove()


def _work_folder(path: Path) -> WorkFolder:
    return WorkFolder(path, SETTINGS, "training of an estimator", ExecutionError)


def read_shard(path: Path) -> tuple[Single, Single] | None:
    """Return points and rows of the shard at `path`, None where it is absent or damaged."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as held:
            return held["points"], held["rows"]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None


def _path(folder: WorkFolder, number: int) -> Path:
    return folder.path / f"shard-{number:05}.npz"
