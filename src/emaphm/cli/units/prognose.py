"""`emaphm prognose`: the remaining useful life of a unit, from its history."""

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
from emaphm.errors import PrognosisError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from emaphm.actuator import Actuator
    from emaphm.prognosis import Costs, Prognosis, Question
    from emaphm.prognosis.batch import UnitOutcome


@Parameter(name="*")
@dataclass(frozen=True)
class Which:
    """Which units are asked about."""

    unit: Annotated[str | None, Parameter(help="Serial number of the unit; or --all.")] = None
    every: Annotated[
        bool, Parameter(name="--all", negative="", help="All units, side by side, in place of --unit.")
    ] = False
    part: Annotated[str | None, Parameter(help="With --all: only units of this part number.")] = None


@Parameter(name="*")
@dataclass(frozen=True)
class Asked:
    """What is asked: how far, how safely or at what costs, and under what stress to come."""

    horizon: Annotated[float, Parameter(help="How far is planned: flight hours from now on [h].")] = 1000.0
    risk: Annotated[
        float, Parameter(help="Largest accepted probability of failure, for the advice without costs.")
    ] = 0.05
    failure_cost: Annotated[
        float | None, Parameter(help="Cost of a failure with its consequences; with --replacement-cost.")
    ] = None
    replacement_cost: Annotated[
        float | None, Parameter(help="Cost of a planned replacement, in the same currency.")
    ] = None
    load: Annotated[
        float | None,
        Parameter(
            help="Mean size of the load to come [N·m, N]; as in the past if left out, so the next two."
        ),
    ] = None
    temperature: Annotated[float | None, Parameter(help="Mean temperature to come [K].")] = None
    cycles_per_hour: Annotated[float | None, Parameter(help="Cycles an hour to come [1/h].")] = None

    def question(self) -> "Question":
        """Return the question; `PrognosisError` where there can be none."""
        from emaphm.prognosis import Question, Stress

        given = (self.load, self.temperature, self.cycles_per_hour)
        ahead = None if all(x is None for x in given) else Stress(*given)
        return Question(self.horizon, self.risk, self._costs(), ahead)

    def _costs(self) -> "Costs | None":
        if self.failure_cost is None and self.replacement_cost is None:
            return None
        if self.failure_cost is None or self.replacement_cost is None:
            raise PrognosisError(
                "advice by costs needs both: give --failure-cost and --replacement-cost, or neither"
            )
        from emaphm.prognosis import Costs

        return Costs(self.failure_cost, self.replacement_cost)


@Parameter(name="*")
@dataclass(frozen=True)
class Written:
    """What is written of a prognosis, apart from the answer."""

    figure: Annotated[
        Path | None, Parameter(help="Draw health over time and the RUL: .png, .svg or .pdf.")
    ] = None
    report: Annotated[Path | None, Parameter(help="Write a report: .html.")] = None
    keep: Annotated[
        bool,
        Parameter(negative="", help="Keep it in the history, for 'emaphm history show' and others."),
    ] = False


def prognose(
    *,
    which: Which = Which(),
    db: Database = DB,
    asked: Asked = Asked(),
    actuator: Annotated[
        str | None, Parameter(help="TOML with the [[requirements]]; that of the last diagnosis if left out.")
    ] = None,
    fleet: Annotated[
        bool, Parameter(help="Learn from the other units of the part number; --no-fleet for this one alone.")
    ] = True,
    written: Written = Written(),
    execution: Execution = Execution(),  # noqa: B008 - frozen
    common: Common = Common(),  # noqa: B008 - frozen
) -> None:
    """Say how long a unit will last, from its history: remaining useful life, risk, advice."""
    common.check((written.figure, FIGURES), (written.report, (".html", ".htm")))
    _check_choice(which, written)
    execution.check()
    if execution.is_given and not which.every:
        raise PrognosisError("--workers and --scheduler are for --all; leave them out with --unit")
    question = asked.question()
    described = described_actuator(actuator) if actuator is not None else None
    if which.unit is None:
        made = _of_all(db, which.part, described, question, execution, common, fleet=fleet)
        _show_all(made, db if written.keep else None, common.as_json)
        return
    result = _of_one(db, which.unit, described, question, common.seed, written, fleet=fleet)
    # First: a full disk must not take the answer too.
    common.show(result.to_dict(), str(result))
    draw(result, written.figure)
    if written.report is not None:
        from emaphm.report.prognosis import write_prognosis

        write_prognosis(result, written.report, force=common.force)


def _of_one(
    db: str,
    unit: str,
    actuator: "Actuator | None",
    question: "Question",
    seed: int,
    written: Written,
    *,
    fleet: bool,
) -> "Prognosis":
    """Return the prognosis of one unit, and keep it in the history where that was asked for."""
    from emaphm.history import History, KeptPrognosis
    from emaphm.prognosis import Evidence, Prior, learnt_prior, prognose
    from emaphm.prognosis.keeping import Curves, earlier_rows, keep_with_curves

    with History.open(db) as history:
        found = history.unit(unit)
        basis = history.basis(unit)
        evidence, described = Evidence.of(found), found.described_by(actuator)
        prior = learnt_prior(history, found, seed=seed, actuator=described) if fleet else Prior()
    keep_past = written.keep or written.report is not None
    result = prognose(evidence, described, question, prior=prior, seed=seed, keep_past=keep_past)
    if written.keep:
        kept = KeptPrognosis.of(basis, result.to_dict())
        with History.open(db) as history:
            keep_with_curves(history, found, kept, Curves.of(result), lambda: earlier_rows(result))
    return result


def _of_all(
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


def _check_choice(which: Which, written: Written) -> None:
    """Refuse what does not say which units, or what only one unit has."""
    if (which.unit is None) is not which.every:
        raise PrognosisError("give --unit, or --all for every unit of the history; one of the two")
    if which.part is not None and not which.every:
        raise PrognosisError("--part chooses among the units of --all; leave it out with --unit")
    if which.every and (written.figure is not None or written.report is not None):
        raise PrognosisError("a figure or a report is of one unit; give --unit in place of --all")


def _show_all(made: "list[UnitOutcome]", keep_in: str | None, as_json: bool) -> None:
    """Print all prognoses, and keep them; what failed is said, and raised where it is all."""
    from emaphm.history import History
    from emaphm.prognosis.keeping import keep_with_curves
    from emaphm.text_table import format_table

    good, bad = [one for one in made if not one.error], [one for one in made if one.error]
    if keep_in is not None:
        with History.open(keep_in) as history:
            for one in good:
                assert one.curves is not None  # noqa: S101 - one that has not failed has them
                # Earlier forecasts would take seven times as long as the prognosis.
                keep_with_curves(history, history.unit(one.unit), one.kept(), one.curves)
    rows = [(one.unit, *_row(one.values)) for one in good]
    within = f"fails within {good[0].values['horizon_hours']:.9g} h" if good else ""
    header = ("unit", "hours", "RUL [h]", "90 %", within, "component", "advice")
    lines = [format_table(header, rows) if rows else "no units"]
    lines += cautions(
        [one.values for one in good], "emaphm prognose --unit UNIT, with the other options as here"
    )
    values = {
        "units": [dict(one.values) for one in good],
        "failed": [{"unit": one.unit, "error": one.error} for one in bad],
    }
    show(values, "\n".join(lines), as_json)
    if bad:
        raise PrognosisError(
            f"{len(bad)} of {len(made)} units have no prognosis, the others are done; the first, "
            f"'{bad[0].unit}': {bad[0].error}"
        )


def _row(values: "Mapping[str, Any]") -> tuple[str, ...]:
    """Return a prognosis as a row of the table of all units, but for the unit."""
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
