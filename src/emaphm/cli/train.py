"""The verb `train`: it makes a setup, calls the library, and prints how good the estimator is."""

import os
from dataclasses import dataclass, replace
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from emaphm.cli.interruption import going_on
from emaphm.cli.options import (
    ActuatorFile,
    Common,
    Execution,
    Manoeuvre,
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
class Recorded:
    """What is recorded in service, how exactly, and what is unknown of it."""

    channels: Annotated[
        str,
        Parameter(
            help="What is recorded, with commas between: columns such as current_A, or for short current, "
            "voltage, position, speed."
        ),
    ] = "current_A,voltage_V"
    noise: Annotated[float, Parameter(help="Sensor noise on the currents, rms [A].")] = 0.05
    adc_bits: Annotated[str, Parameter(help="Resolution of the sensors' converters; 'exact' for none.")] = (
        "12"
    )
    nuisance: Annotated[
        str | None,
        Parameter(
            help="What is unknown and no fault, with commas between, as for diagnose; or 'none'. As the TOML "
            "says if left out."
        ),
    ] = None

    def setup(self, actuator: "Actuator", driven: "Command", manoeuvre: Manoeuvre) -> "RecordingSetup":
        """Return what the estimator is for: these recordings of an actuator that is driven so."""
        from emaphm.amortized.recording_setup import RecordingSetup

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
class Learning:
    """How much is learnt from, and where that is kept."""

    simulations: Annotated[
        int, Parameter(converter=whole_number, help="How many to learn from: more, and it errs less.")
    ] = 196_608
    epochs: Annotated[
        int | None,
        Parameter(
            converter=whole_number,
            help="Most passes of the first network over them; it stops when it learns no more.",
        ),
    ] = None
    folder: Annotated[
        Path | None,
        Parameter(
            help="Where simulations are kept, to go on after an interruption or with more of them; "
            "OUT.training if left out, which is removed in the end."
        ),
    ] = None

    def settings(self) -> "TrainingSettings":
        """Return the settings of the training; `MethodError` where there can be none."""
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
    recorded: Recorded = Recorded(),
    learning: Learning = Learning(),
    execution: Execution = Execution(),  # noqa: B008 - frozen
    common: Common = Common(),  # noqa: B008 - frozen
) -> None:
    """Train an estimator for one actuator and manoeuvre, which `diagnose --estimator` asks.

    Simulates the reference model with random faults, then trains a network to name them from the channels.
    """
    common.check((out, (ENDING,)))
    execution.check()
    described = described_actuator(actuator)
    from emaphm.amortized.simulating import remove_training_folder
    from emaphm.amortized.train import train_estimator

    settings = learning.settings()
    driven = manoeuvre.command_for(described)
    if not common.as_json and (jump := manoeuvre.jump_of(driven)):
        say(jump)
    setup = recorded.setup(described, driven, manoeuvre)
    place = learning.folder or out.with_name(f"{out.name}.training")
    kept = f"simulations are kept in {place}; the same command goes on"
    with going_on(kept), counter("simulating", common.as_json) as on_shard:
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
            on_stage=_printed(quiet=common.as_json),
            on_epoch=_printed(quiet=common.as_json),
        )
    written = _saved(estimator, out, place, force=common.force)
    if learning.folder is None:
        remove_training_folder(place)
    size = written.stat().st_size
    common.show(_values(estimator, written, size), _text(estimator, written, size))


def _saved(estimator: "Estimator", out: Path, folder: Path, *, force: bool) -> Path:
    """Return where the estimator is now: in `out`, or next to a file that has appeared there meanwhile.

    `OutputError` where it cannot be written there; it is in the training folder then, unless that is as full.
    """
    written = out if force else _not_taken(out)
    try:
        estimator.save(written)
    except OutputError as error:
        raise OutputError(f"{error}{_spared(estimator, folder / out.name)}") from None
    if written != out:
        say(f"{out} has appeared meanwhile and is left as it is; the estimator is in {written}")
    return written


def _spared(estimator: "Estimator", path: Path) -> str:
    """Save an estimator elsewhere and return what says so, nothing where that is not writable either."""
    try:
        estimator.save(path)
    except OutputError:
        return ""
    return f"; the estimator is in {path}: copy it from there"


def _not_taken(out: Path) -> Path:
    """Return `out`, or a name next to it where there is something by now: training takes hours."""
    names = (out.with_stem(f"{out.stem}-{number}") for number in count(2))
    return next(path for path in chain([out], names) if not os.path.lexists(path))


def _bits(text: str) -> int | None:
    if text == "exact":
        return None
    try:
        return int(text)
    except ValueError:
        raise MethodError(f"--adc-bits {text}: give a whole number, or 'exact'") from None


def _printed(*, quiet: bool) -> "Callable[[object], None] | None":
    """Return what prints each stage and epoch on stderr, for whoever watches or keeps a log of it."""
    return None if quiet else lambda what: say_plainly(str(what))


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


def _text(estimator: "Estimator", out: Path, size: int) -> str:
    from emaphm.text_table import format_table

    facts = estimator.facts
    judged = facts["judgement"]
    rows = [
        (name, f"{100 * share:.1f} %", f"{judged['rank_chi2'][name]:.1f}")
        for name, share in judged["coverage95"].items()
    ]
    header = ("coordinate", "truth in the 95 % interval", f"χ² of ranks, ≤ {judged['rank_chi2_limit']:.1f}")
    errors = (
        f"{judged['draws']} held-out simulations: error {judged['median_error_percent']:.2f} % (median), "
        f"{judged['p95_error_percent']:.2f} % (95th percentile); {100 * judged['not_believed']:.1f} % are "
        "not believed."
    )
    costs = (
        f"{facts['simulations']} simulations in {facts['simulation_seconds']:.0f} s, {facts['epochs']} "
        f"epochs in {facts['training_seconds']:.0f} s, seed {facts['seed']}."
    )
    lines = [
        format_table(header, rows),
        errors,
        *(f"Note: {note}." for note in facts["notes"]),
        costs,
        f"Written to {out} ({size / 2**20:.1f} MiB)",
    ]
    return "\n".join(lines)
