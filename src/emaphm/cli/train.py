"""The verb `train`: reads the setup, calls the library, and prints the accuracy of the estimator."""

import os
from dataclasses import dataclass, replace
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from emaphm.cli.interruption import resumable
from emaphm.cli.options import (
    ActuatorFile,
    Common,
    Execution,
    Manoeuvre,
    check_noise,
    described_actuator,
    names_in,
    whole_number,
)
from emaphm.cli.output import counter, say, say_plainly
from emaphm.errors import MethodError, OutputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from emaphm.actuator import Actuator, Command
    from emaphm.amortized import Estimator
    from emaphm.amortized.networks.training import TrainingSettings
    from emaphm.amortized.recording_setup import RecordingSetup

ENDING = ".estimator"


@Parameter(name="*")
@dataclass(frozen=True)
class RecordedOptions:
    """Recorded channels in service, their noise and resolution, and the nuisances."""

    channels: Annotated[
        str,
        Parameter(
            help="Recorded channels, separated by commas: columns such as current_A, or the short names "
            "current, voltage, position, speed."
        ),
    ] = "current_A,voltage_V"
    noise: Annotated[float, Parameter(help="Sensor noise on the currents, rms [A].")] = 0.05
    adc_bits: Annotated[
        str,
        Parameter(help="Resolution of the sensors' converters [bit], 4 to 24; 'exact' for no quantisation."),
    ] = "12"
    nuisance: Annotated[
        str | None,
        Parameter(
            help="Nuisance parameters to estimate with the faults, separated by commas, as for 'emaphm "
            "diagnose'; or 'none'. Default: the TOML's [nuisances]."
        ),
    ] = None

    def setup(self, actuator: "Actuator", driven: "Command", manoeuvre: Manoeuvre) -> "RecordingSetup":
        """Return the setup for which the estimator is trained: actuator, command and recorded channels."""
        from emaphm.amortized.recording_setup import RecordingSetup

        check_noise(self.noise, actuator)
        return RecordingSetup.of(
            actuator,
            driven,
            duration=manoeuvre.duration,
            sample_rate=manoeuvre.sample_rate,
            initial_position=manoeuvre.about,
            channels=names_in(self.channels),
            noise=self.noise,
            adc_bits=_bits(self.adc_bits),
            nuisances=None if self.nuisance is None else names_in(self.nuisance),
        )


@Parameter(name="*")
@dataclass(frozen=True)
class TrainingOptions:
    """Size of the training, and the folder of its simulations."""

    simulations: Annotated[
        int,
        Parameter(
            converter=whole_number,
            help="Number of simulations for the training; more simulations reduce the error.",
        ),
    ] = 196_608
    epochs: Annotated[
        int | None,
        Parameter(
            converter=whole_number,
            help="Largest number of epochs of the first network; training stops earlier when the validation "
            "loss no longer falls. Default 40, fewer if the simulations are many.",
        ),
    ] = None
    folder: Annotated[
        Path | None,
        Parameter(
            help="Folder for the simulations, to resume after an interruption or to train with more of them "
            "later. Default OUT.training, which is removed at the end."
        ),
    ] = None

    def settings(self) -> "TrainingSettings":
        """Return the settings of the training; `MethodError` if they are invalid."""
        from emaphm.amortized.networks.training import TRAINING

        if self.epochs is None:
            return TRAINING
        if self.epochs < 1:
            raise MethodError(f"--epochs {self.epochs}: give 1 or more")
        return replace(TRAINING, epochs=self.epochs, most_steps=None)


def train(
    *,
    out: Annotated[Path, Parameter(name=("--out", "-o"), help=f"Estimator to write: {ENDING}.")],
    actuator: ActuatorFile = "thesis",
    manoeuvre: Manoeuvre = Manoeuvre(),  # noqa: B008 - frozen
    recorded: RecordedOptions = RecordedOptions(),
    learning: TrainingOptions = TrainingOptions(),
    execution: Execution = Execution(),  # noqa: B008 - frozen
    common: Common = Common(),  # noqa: B008 - frozen
) -> None:
    """Train an estimator of faults for one actuator and manoeuvre, for `diagnose --estimator`.

    Simulates the reference model with random faults, then trains a network to estimate them from the
    channels.
    """
    common.check((out, (ENDING,)))
    execution.check()
    described = described_actuator(actuator)
    from emaphm.amortized.simulating import remove_training_folder
    from emaphm.amortized.train import train_estimator

    settings = learning.settings()
    driven = manoeuvre.command_for(described)
    for note in () if common.as_json else manoeuvre.notes_on(driven):
        say(note)
    setup = recorded.setup(described, driven, manoeuvre)
    place = learning.folder or out.with_name(f"{out.name}.training")
    hint = f"simulations are stored in {place}; the same command resumes"
    with resumable(hint), counter("simulating", common.as_json) as on_shard:
        estimator = train_estimator(
            setup,
            driven,
            place,
            simulations=learning.simulations,
            seed=common.seed,
            workers=execution.workers,
            scheduler=execution.scheduler,
            settings=settings,
            on_shard=on_shard,
            on_stage=_stderr_printer(quiet=common.as_json),
            on_epoch=_stderr_printer(quiet=common.as_json),
        )
    written = _saved(estimator, out, place, force=common.force)
    if learning.folder is None:
        remove_training_folder(place)
    size, notes = written.stat().st_size, list(estimator.facts["notes"])
    if written != out:
        notes.append(
            f"{out} has appeared during the training and is not replaced; the estimator is in {written}"
        )
    values = _values(estimator, written, size) | {"notes": notes}
    common.show(values, _text(estimator, written, size, notes))


def _saved(estimator: "Estimator", out: Path, folder: Path, *, force: bool) -> Path:
    """Save the estimator in `out`, or under a free name if a file has appeared there; return its path.

    `OutputError` if it cannot be written; it is then saved in the training folder, if that is writable.
    """
    written = out if force else _free_path(out)
    try:
        estimator.save(written)
    except OutputError as error:
        raise OutputError(f"{error}{_save_copy(estimator, folder / out.name)}") from None
    return written


def _save_copy(estimator: "Estimator", path: Path) -> str:
    """Save an estimator in `path` and return a note on it, or "" if `path` is not writable."""
    try:
        estimator.save(path)
    except OutputError:
        return ""
    return f"; the estimator is in {path}: copy it from there"


def _free_path(out: Path) -> Path:
    """Return `out`, or a numbered name if a file exists there by now: training takes hours."""
    names = (out.with_stem(f"{out.stem}-{number}") for number in count(2))
    return next(path for path in chain([out], names) if not os.path.lexists(path))


def _bits(text: str) -> int | None:
    if text == "exact":
        return None
    try:
        return int(text)
    except ValueError:
        raise MethodError(f"--adc-bits {text}: give a whole number, or 'exact'") from None


def _stderr_printer(*, quiet: bool) -> "Callable[[object], None] | None":
    """Return a function that prints each stage and epoch on stderr, None if `quiet`."""
    return None if quiet else lambda step: say_plainly(str(step))


def _values(estimator: "Estimator", out: Path, size: int) -> dict[str, Any]:
    return {
        "estimator": str(out),
        "bytes": size,
        "actuator": estimator.setup.actuator.name,
        "actuator_hash": estimator.actuator_hash,
        "channels": list(estimator.setup.channels),
        "parameters": estimator.network.parameters,
        **estimator.facts,
    }


def _text(estimator: "Estimator", out: Path, size: int, notes: list[str]) -> str:
    from emaphm.text_table import counted, format_table

    facts = estimator.facts
    epochs = counted(facts["epochs"], "epoch")
    accuracy = facts["judgement"]
    rows = [
        (name, f"{100 * share:.1f} %", f"{accuracy['rank_chi2'][name]:.1f}")
        for name, share in accuracy["coverage95"].items()
    ]
    header = ("coordinate", "truth in the 95 % interval", f"χ² of ranks, ≤ {accuracy['rank_chi2_limit']:.1f}")
    errors = (
        f"{accuracy['draws']} held-out simulations: error {accuracy['median_error_percent']:.2f} % (median), "
        f"{accuracy['p95_error_percent']:.2f} % (95th percentile); {100 * accuracy['not_believed']:.1f} % "
        "of the answers are not accepted by their own tests: these recordings would be searched."
    )
    costs = (
        f"{facts['simulations']} simulations in {facts['simulation_seconds']:.0f} s, {epochs} "
        f"in {facts['training_seconds']:.0f} s, seed {facts['seed']}."
    )
    lines = [
        format_table(header, rows),
        errors,
        *(f"Note: {note}." for note in notes),
        costs,
        f"Written to {out} ({size / 2**20:.1f} MiB)",
    ]
    return "\n".join(lines)
