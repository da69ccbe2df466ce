"""`emaphm prognose`: the remaining useful life of a unit, from its history."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from emaphm.cli.history import DB, Database, Unit
from emaphm.cli.options import (
    FIGURES,
    AsJson,
    Force,
    Seed,
    check_output,
    check_seed,
    described_actuator,
)
from emaphm.cli.output import draw, show
from emaphm.errors import PrognosisError

if TYPE_CHECKING:
    from emaphm.prognosis import Costs


def prognose(
    *,
    unit: Unit,
    db: Database = DB,
    horizon: Annotated[float, Parameter(help="How far is planned: flight hours from now on [h].")] = 1000.0,
    risk: Annotated[
        float, Parameter(help="Largest accepted probability of failure, for the advice without costs.")
    ] = 0.05,
    failure_cost: Annotated[
        float | None, Parameter(help="Cost of a failure with its consequences; with --replacement-cost.")
    ] = None,
    replacement_cost: Annotated[
        float | None, Parameter(help="Cost of a planned replacement, in the same currency.")
    ] = None,
    load: Annotated[
        float | None,
        Parameter(
            help="Mean size of the load to come [N·m, N]; as in the past if left out, so the next two."
        ),
    ] = None,
    temperature: Annotated[float | None, Parameter(help="Mean temperature to come [K].")] = None,
    cycles_per_hour: Annotated[float | None, Parameter(help="Cycles an hour to come [1/h].")] = None,
    actuator: Annotated[
        str | None, Parameter(help="TOML with the [[requirements]]; that of the last diagnosis if left out.")
    ] = None,
    fleet: Annotated[
        bool, Parameter(help="Learn from the other units of the part number; --no-fleet for this one alone.")
    ] = True,
    figure: Annotated[
        Path | None, Parameter(help="Draw health over time and the RUL: .png, .svg or .pdf.")
    ] = None,
    report: Annotated[Path | None, Parameter(help="Write a report: .html.")] = None,
    seed: Seed = 0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Say how long a unit will last, from its history: remaining useful life, risk, advice."""
    check_seed(seed)
    check_output(figure, FIGURES, force=force)
    check_output(report, (".html", ".htm"), force=force)
    costs = _costs(failure_cost, replacement_cost)
    described = described_actuator(actuator) if actuator is not None else None
    from emaphm.prognosis import Evidence, Question, Stress, fellows, fleet_prior
    from emaphm.prognosis import prognose as ask

    given = (load, temperature, cycles_per_hour)
    ahead = None if all(x is None for x in given) else Stress(*given)
    question = Question(horizon, risk, costs, ahead)
    from emaphm.history import History

    with History.open(db) as history:
        found = history.unit(unit)
        evidence, described = Evidence.of(found), described or found.actuator
        others = fellows(history, found) if fleet else []
    result = ask(evidence, described, question, prior=fleet_prior(others, seed=seed), seed=seed)
    draw(result, figure)
    if report is not None:
        from emaphm.report.prognosis import write_prognosis

        write_prognosis(result, report, force=force)
    show(result.to_dict(), str(result), as_json)


def _costs(failure: float | None, replacement: float | None) -> "Costs | None":
    if failure is None and replacement is None:
        return None
    if failure is None or replacement is None:
        raise PrognosisError(
            "advice by costs needs both: give --failure-cost and --replacement-cost, or neither"
        )
    from emaphm.prognosis import Costs

    return Costs(failure, replacement)
