"""The verb `prognose`: the remaining useful life of units, from their history."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from emaphm.cli.options import (
    FIGURES,
    Common,
    Execution,
    described_actuator,
)
from emaphm.cli.output import counter, draw, show
from emaphm.cli.units.cautions import cautions
from emaphm.cli.units.history_options import DB, Database
from emaphm.errors import HistoryError, HistoryFormError, HistoryUnavailableError, PrognosisError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from emaphm.actuator import Actuator
    from emaphm.history.basis import Basis
    from emaphm.prognosis import Costs, Prognosis, Question
    from emaphm.prognosis.batch import UnitOutcome


@Parameter(name="*")
@dataclass(frozen=True)
class UnitChoice:
    """Units whose life is predicted."""

    unit: Annotated[str | None, Parameter(help="Serial number of the unit; required without --all.")] = None
    every: Annotated[
        bool,
        Parameter(name="--all", negative="", help="Predict all units of the history, in parallel processes."),
    ] = False
    part: Annotated[
        str | None, Parameter(help="With --all: select only units of this part number; default all units.")
    ] = None


@Parameter(name="*")
@dataclass(frozen=True)
class QuestionOptions:
    """Horizon, accepted risk or costs, and future stress of a prognosis."""

    horizon: Annotated[float, Parameter(help="Planning horizon: flight hours from now on [h].")] = 1000.0
    risk: Annotated[
        float,
        Parameter(help="Largest accepted probability of failure, 0 to 1, for the advice without costs."),
    ] = 0.05
    failure_cost: Annotated[
        float | None,
        Parameter(help="Cost of a failure with its consequences, in any currency; needs --replacement-cost."),
    ] = None
    replacement_cost: Annotated[
        float | None,
        Parameter(help="Cost of a planned replacement, in the same currency; needs --failure-cost."),
    ] = None
    load: Annotated[
        float | None,
        Parameter(help="Future mean absolute load [N·m; N if linear]; default as in the past."),
    ] = None
    temperature: Annotated[
        float | None, Parameter(help="Future mean temperature [K]; default as in the past.")
    ] = None
    cycles_per_hour: Annotated[
        float | None, Parameter(help="Future cycles per flight hour [1/h]; default as in the past.")
    ] = None

    def question(self) -> "Question":
        """Return the question for the prognosis; `PrognosisError` if it is invalid."""
        from emaphm.prognosis import Question, Stress

        given = (self.load, self.temperature, self.cycles_per_hour)
        future = None if all(x is None for x in given) else Stress(*given)
        return Question(self.horizon, self.risk, self._costs(), future)

    def _costs(self) -> "Costs | None":
        if self.failure_cost is None and self.replacement_cost is None:
            return None
        if self.failure_cost is None or self.replacement_cost is None:
            raise PrognosisError(
                "advice from costs needs both costs: give --failure-cost and --replacement-cost, or neither"
            )
        from emaphm.prognosis import Costs

        return Costs(self.failure_cost, self.replacement_cost)


@Parameter(name="*")
@dataclass(frozen=True)
class Outputs:
    """Figure, report and stored copy of a prognosis."""

    figure: Annotated[
        Path | None,
        Parameter(help="Write a figure of the health over time and of the RUL: .png, .svg or .pdf."),
    ] = None
    report: Annotated[Path | None, Parameter(help="Write a report of one unit: .html or .htm.")] = None
    keep: Annotated[
        bool,
        Parameter(
            negative="",
            help="Store the prognosis in the history, e.g. for 'emaphm history show' and 'serve'.",
        ),
    ] = False


def prognose(
    *,
    chosen: UnitChoice = UnitChoice(),
    db: Database = DB,
    question: QuestionOptions = QuestionOptions(),
    actuator: Annotated[
        str | None,
        Parameter(
            help="TOML description with the [[requirements]]; default the description of the last diagnosis."
        ),
    ] = None,
    fleet: Annotated[
        bool, Parameter(help="Use the other units of the same part number for the prior.")
    ] = True,
    outputs: Outputs = Outputs(),
    execution: Execution = Execution(),  # noqa: B008 - frozen
    common: Common = Common(),  # noqa: B008 - frozen
) -> None:
    """Predict the remaining useful life (RUL) and risk of a unit from its history, and advise an action."""
    common.check((outputs.figure, FIGURES), (outputs.report, (".html", ".htm")))
    _check_choice(chosen, outputs)
    execution.check()
    if execution.is_given and not chosen.every:
        raise PrognosisError("--workers and --scheduler are for --all; leave them out with --unit")
    asked = question.question()
    described = described_actuator(actuator) if actuator is not None else None
    if chosen.unit is None:
        made = _prognose_all(db, chosen.part, described, asked, execution, common, fleet=fleet)
        _show_all(made, db if outputs.keep else None, common.as_json)
        return
    result, basis = _prognose_unit(db, chosen.unit, described, asked, common.seed, outputs, fleet=fleet)
    # Before it is stored and files are written: a full disk must not lose the answer too.
    common.show(result.to_dict(), str(result))
    if outputs.keep:
        _keep_unit(db, result, basis)
    draw(result, outputs.figure)
    if outputs.report is not None:
        from emaphm.report.prognosis import write_prognosis

        write_prognosis(result, outputs.report, force=common.force)
        if not common.as_json:
            common.show({}, f"Report written to {outputs.report}")


def _prognose_unit(
    db: str,
    unit: str,
    actuator: "Actuator | None",
    question: "Question",
    seed: int,
    outputs: Outputs,
    *,
    fleet: bool,
) -> "tuple[Prognosis, Basis]":
    """Return the prognosis of one unit, and the basis from which it was made."""
    from emaphm.history import History
    from emaphm.prognosis import Evidence, Prior, learnt_prior, prognose

    with History.open(db) as history:
        stored = history.unit(unit)
        basis = history.basis(unit)
        evidence, described = Evidence.of(stored), stored.described_by(actuator)
        prior = learnt_prior(history, stored, seed=seed, actuator=described) if fleet else Prior()
    keep_past = outputs.keep or outputs.report is not None
    return prognose(evidence, described, question, prior=prior, seed=seed, keep_past=keep_past), basis


def _keep_unit(db: str, result: "Prognosis", basis: "Basis") -> None:
    """Store the prognosis of one unit in the history, with its curves."""
    from emaphm.history import History, KeptPrognosis
    from emaphm.prognosis.keeping import Curves, earlier_rows, keep_with_curves

    kept = KeptPrognosis.of(basis, result.to_dict())
    with History.open(db) as history:
        unit = history.unit(result.evidence.unit)
        keep_with_curves(history, unit, kept, Curves.of(result), lambda: earlier_rows(result))


def _prognose_all(
    db: str,
    part: str | None,
    actuator: "Actuator | None",
    question: "Question",
    execution: Execution,
    common: Common,
    *,
    fleet: bool,
) -> "list[UnitOutcome]":
    from emaphm.prognosis.batch import prognose_all

    with counter("prognosing", common.as_json and sys.stdout.isatty()) as count:
        return list(
            prognose_all(
                db,
                question,
                part_number=part,
                actuator=actuator,
                fleet=fleet,
                seed=common.seed,
                workers=execution.workers,
                scheduler=execution.scheduler,
                on_unit=count,
            )
        )


def _check_choice(chosen: UnitChoice, outputs: Outputs) -> None:
    """Refuse an ambiguous choice of units, and outputs of one unit together with --all."""
    if (chosen.unit is None) is not chosen.every:
        raise PrognosisError("give either --unit, or --all for every unit of the history")
    if chosen.part is not None and not chosen.every:
        raise PrognosisError("--part chooses among the units of --all; leave it out with --unit")
    if chosen.every and (outputs.figure is not None or outputs.report is not None):
        raise PrognosisError("a figure or a report is of one unit; give --unit in place of --all")


def _show_all(made: "list[UnitOutcome]", keep_in: str | None, as_json: bool) -> None:
    """Print all prognoses and store them in the history `keep_in`; `PrognosisError` if a unit has none."""
    from emaphm.text_table import format_table

    finished = [outcome for outcome in made if not outcome.error]
    failed = [outcome for outcome in made if outcome.error]
    rows = [(outcome.unit, *_row(outcome.values)) for outcome in finished]
    within = f"fails within {finished[0].values['horizon_hours']:.9g} h" if finished else ""
    header = ("unit", "hours", "RUL [h]", "90 %", within, "component", "advice")
    lines = [format_table(header, rows) if rows else "no units"]
    lines += cautions(
        [outcome.values for outcome in finished], "emaphm prognose --unit UNIT, with the same other options"
    )
    values = {
        "units": [dict(outcome.values) for outcome in finished],
        "failed": [{"unit": outcome.unit, "error": outcome.error} for outcome in failed],
    }
    show(values, "\n".join(lines), as_json)
    # After the answer, which took minutes: a full disk must not lose it too.
    if keep_in is not None:
        _keep_all(finished, keep_in)
    if failed:
        raise PrognosisError(
            f"{len(failed)} of {len(made)} units have no prognosis, the others are done; the first, "
            f"'{failed[0].unit}': {failed[0].error}"
        )


def _keep_all(finished: "list[UnitOutcome]", where: str) -> None:
    """Store prognoses in the history; `HistoryError` if a unit was withdrawn meanwhile, after all others."""
    from emaphm.history import History
    from emaphm.prognosis.keeping import keep_with_curves

    refused: list[HistoryError] = []
    with History.open(where) as history:
        for outcome in finished:
            assert outcome.curves is not None  # noqa: S101 - finished outcomes have curves
            try:
                # Without earlier forecasts: they would take seven times as long as the prognosis.
                keep_with_curves(history, history.unit(outcome.unit), outcome.kept(), outcome.curves)
            except (HistoryFormError, HistoryUnavailableError):
                raise
            except HistoryError as error:
                refused.append(error)
    if refused:
        raise HistoryError(
            f"{len(refused)} of {len(finished)} prognoses could not be stored, the others are; the first: "
            f"{refused[0]}"
        )


def _row(values: "Mapping[str, Any]") -> tuple[str, ...]:
    """Return a prognosis as a row of the table of all units, without the unit's name."""
    from emaphm.prognosis.advice import advice_in_words
    from emaphm.text_table import NOTHING

    rul, advice, failed_at = values["rul_hours"], values["advice"], values["failed_at_hours"]
    interval = " to ".join(_hours(end) for end in rul["interval90"])
    return (
        f"{values['hours']:.9g}",
        *((_hours(rul["median"]), interval) if failed_at is None else ("failed", "–")),
        f"{100 * values['probability_of_failure']:.1f} %",
        values["component"] or (NOTHING if failed_at is None else "not found"),
        advice_in_words(advice) if failed_at is None else f"failed at {failed_at:,.9g} h",
    )


def _hours(hours: float | None) -> str:
    return "not in sight" if hours is None else f"{hours:,.0f}"
