"""The page of the study of predictions on a synthetic fleet.

    python -m emaphm.report.fleet.page studies/fleet docs

reads the results of `python -m emaphm.study.fleet studies/fleet`, and writes ``fleet.md`` with the figures
in ``fleet/``.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from emaphm.errors import EmaphmError, StudyError
from emaphm.fleet.synthetic import drawn_unit
from emaphm.fleet.synthetic.growth import LAWS
from emaphm.fleet.synthetic.population import Population
from emaphm.output_files import make_folder, written_whole
from emaphm.plotting.fleet import draw_acting, draw_calibration, draw_scores, draw_tracks
from emaphm.plotting.svg import plain_style, svg
from emaphm.prognosis.metrics import coverage
from emaphm.report.fleet.acting import acting_lines, over_life_lines
from emaphm.report.fleet.warnings import REQUIRED_WARNED, share_in_time, warning_lines
from emaphm.report.markdown import incomplete
from emaphm.study.fleet.diagnoses import Quality, quality
from emaphm.study.fleet.judging import (
    ALONE,
    CLAIRVOYANT,
    INFORMED,
    LAW_AND_LEVEL,
    SHARES,
    WITH_FLEET,
    WITH_LARGER,
)
from emaphm.study.fleet.run import (
    DRAWN,
    FLEET_UNITS,
    JUDGED,
    MANY,
    PARTS,
    PLAN,
    RECORDED,
    StudyFolder,
    recorded_fleet,
    results,
)
from emaphm.study.fleet.scores import HEADER, alpha_lambda_interval, scores, ways
from emaphm.text_table import markdown_table

Units = Sequence[Mapping[str, Any]]

CLAIRVOYANTS = (LAW_AND_LEVEL, CLAIRVOYANT)

INFORMATION = (
    (
        WITH_FLEET,
        "the diagnoses and the recorded stress of the unit and of its fleet",
        "the population of the fleet",
    ),
    (
        INFORMED,
        "the unit's diagnoses and recorded stress",
        "the laws of its components, their parameters and lives, and the unit's mission",
    ),
    (
        LAW_AND_LEVEL,
        "the law of each component, its true level at each past check flight, and the recorded stress",
        "the parameters of these laws, the lives (and so the rates), and the unit's mission",
    ),
    (
        CLAIRVOYANT,
        "the law of each component with all parameters, its life and true level, and the unit's mission",
        "future random events: jumps, drift, stress, onsets and changes of rate",
    ),
)
"""Prediction method, the information that it uses, and the information that it does not use."""

REQUIRED_SHARE = 0.9
"""Required alpha-lambda, as a share of that of the clairvoyant predictions."""

REQUIRED_COVERAGE = (0.85, 0.95)
"""Required range of the coverage of 90 % intervals."""

TRACKS = (
    "Predicted with the fleet's prior from each unit's own past: median and 90 % interval, the true RUL "
    "(black) and ±20 % of it (dotted). The title names the component that failed and its law.\n"
)

ANOTHER_FLEET = """
## Simulating another fleet

```console
$ emaphm fleet simulate -o fleet --units 6 --flights 12
$ emaphm prognose --unit SYNTHETIC-0003 --db fleet/history.sqlite --report SYNTHETIC-0003.html
```

The commands simulate six units with up to 12 check flights each, one in 80 h (`--interval`), record and
diagnose them, and store the diagnoses in a history, with the removals of failed units. They predict the
life of each working unit with the other units as its prior. `--simulate-only` stops after the
recordings. The same command continues a stopped run; in the same folder, another plan or another version
of the code that decides a diagnosis is refused. `--workers` and `--scheduler` (Dask, whose workers share
the folder) are as for `emaphm diagnose`; `--db` selects another history than the folder's own. The folder
contains:

| file | content |
| --- | --- |
| `flights.csv`, `recordings/` | an operator's data: unit, hours, cycles, load, temperature, recordings |
| `actuator.toml` | the actuator with its requirements |
| `history.sqlite`, `prognoses.ndjson` | diagnoses, removals, findings; JSON of each working unit |
| `truth/` | data that no operator has: laws and failures (`units.json`), levels (`levels.parquet`) |
"""

CALIBRATION = (
    "Diagnosed recordings and drawn diagnoses; with the fleet's prior (solid), without it (dotted). A flat "
    "line is calibrated; mass at the right means failures later than predicted.\n"
)


def fleet_page(
    found: Mapping[str, Units], total: int, diagnosed: Quality, folder: str, units: int = PLAN.units
) -> tuple[str, dict[str, bytes]]:
    """Return the page as Markdown with links to figures in `folder`, and the figures as SVG by name.

    `found` contains the finished units by level, of `total` units; the recorded fleet has `units`.

    Raises
    ------
    StudyError
        A level of the study has no results.
    """
    recorded, drawn = found[RECORDED], found[DRAWN]
    if not recorded or not drawn:
        raise StudyError("the study has no results yet; run: python -m emaphm.study.fleet studies/fleet")
    with plain_style():
        figures = {
            "scores": svg(draw_scores(recorded)),
            "tracks": svg(draw_tracks(recorded)),
            "acting": svg(draw_acting(recorded)),
            "calibration": svg(draw_calibration([*recorded, *drawn])),
        }
    lines = [
        "# Predictions on a synthetic fleet\n",
        *incomplete(len(recorded) + len(drawn), total),
        *_introduction(recorded, drawn, diagnosed, units),
        "\n## Quality of the predictions\n",
        *_verdicts(recorded, drawn),
        *_shortfalls(recorded),
        f"\n![Scores of each prediction method, synthetic fleet]({folder}/scores.svg)\n",
        *_tables("Diagnosed recordings", recorded),
        *_tables("Drawn diagnoses", drawn),
        "\n## A new unit\n",
        *_new_unit(recorded),
        "\n## Over a life\n",
        f"![RUL over the life of synthetic units]({folder}/tracks.svg)\n",
        TRACKS,
        *over_life_lines(recorded),
        "",
        *warning_lines(recorded),
        "\n## Consequences of acting on the predictions\n",
        *acting_lines(recorded, PLAN.interval),
        f"![Failures in service and life wasted, by prediction method]({folder}/acting.svg)\n",
        "\n## By the law of the failed component\n",
        _by_law([*recorded, *drawn]),
        "\n## Calibration\n",
        f"![Probability integral transforms, synthetic fleet]({folder}/calibration.svg)\n",
        CALIBRATION,
        "\n## Population of the fleet\n",
        *_population(PLAN.drawn_from),
        ANOTHER_FLEET,
    ]
    return "\n".join(lines) + "\n", figures


def _introduction(recorded: Units, drawn: Units, diagnosed: Quality, units: int) -> Iterator[str]:
    fewer = "" if units == PLAN.units else f" --units {units}"
    unknown_laws = sorted({unit["law"] for unit in [*recorded, *drawn] if not LAWS[unit["law"]].known})
    yield (
        f"Made by `python -m emaphm.study.fleet studies/fleet{fewer}`, then `python -m "
        f"emaphm.report.fleet.page studies/fleet docs{fewer}`. **Every unit here is synthetic**: drawn from "
        "the laws below, run to failure, recorded by the reference model, diagnosed by `emaphm`'s own "
        "methods, and predicted from its own past and the other units' histories alone. The results are "
        "valid for fleets that degrade in these ways, and are no proof for a real fleet.\n"
    )
    yield (
        f"*Diagnosed recordings*: {len(recorded)} failed units of {units}, with a check flight each "
        f"{PLAN.interval:g} h; {diagnosed.recordings} recordings, each with its own load, temperature and "
        f"supply. {100 * diagnosed.explained:.1f} % are explained; the error of a level is "
        f"{diagnosed.error:.4f} (rms), {100 * diagnosed.coverage:.0f} % of levels are within two standard "
        f"errors. The units are in {PARTS} parts; the fleet of a unit is the "
        f"{units - units // PARTS} units of the other parts.\n"
    )
    yield (
        f"*Drawn diagnoses*: {len(drawn)} further units, for the statistics: each diagnosis is the truth "
        "plus an error drawn from the covariance that the diagnosis of a recording stated at nearby levels. "
        f"The fleet is {FLEET_UNITS} units that are not judged; a larger fleet has {MANY.units - JUDGED} "
        "units, these and others.\n"
    )
    yield f"Laws that the filter does not have: {', '.join(unknown_laws)}."


def _verdicts(recorded: Units, drawn: Units) -> Iterator[str]:
    rows = []
    judged = (
        ("diagnosed recordings", recorded, WITH_FLEET),
        ("drawn diagnoses", drawn, WITH_FLEET),
        (f"drawn diagnoses, {MANY.units - JUDGED} units in the fleet", drawn, WITH_LARGER),
    )
    for name, units, way_of_ours in judged:
        for share in (0.5, 0.75):
            ours = scores(units, way_of_ours, share)
            low, high = alpha_lambda_interval(ours)
            compared: list[str] = []
            for way in CLAIRVOYANTS:
                best = scores(units, way, share).alpha_lambda
                compared += [f"{best:.2f}", _ratio(ours.alpha_lambda, best)]
            rows.append(
                (
                    f"{name}, λ = {share:g}",
                    f"{ours.alpha_lambda:.2f} ({low:.2f} to {high:.2f})",
                    *compared,
                    f"{scores(units, INFORMED, share).alpha_lambda:.2f}",
                    f"{100 * (ours.coverage or 0):.0f} %",
                    f"{100 * ours.late:.0f} %",
                )
            )
    header = (
        "",
        "alpha-lambda (90 % interval)",
        *(cell for way in CLAIRVOYANTS for cell in (way, "share of it")),
        "Bayes' rule",
        "coverage of 90 %",
        "late",
    )
    yield markdown_table(header, rows)
    yield (
        f"\nRequired: {100 * REQUIRED_SHARE:.0f} % of the alpha-lambda (α 0.2, β 0.5) of a clairvoyant "
        f"prediction with known law and true level, and a coverage of {100 * REQUIRED_COVERAGE[0]:.0f} to "
        f"{100 * REQUIRED_COVERAGE[1]:.0f} %. The table has two such clairvoyant predictions, and our share "
        "of each. *Late*: the median exceeds the true RUL by more than 20 %. Our prediction with the fleet's "
        "prior is corrected by the errors of past predictions of the fleet's failed units, and depends "
        "mostly on the pace of its units ([prognosis](prognosis.md#degradation)).\n"
    )
    for way, used, not_used in INFORMATION:
        yield f"- *{way}* uses {used}; it does not use {not_used}."
    yield (
        "\nThe last three also use the population from which the fleet is drawn: the laws of each component "
        "with their shares, the ranges of their parameters, the distributions of lives and stress, and how "
        "stress determines ageing. The two predictions with unknown parameters apply Bayes' rule to it. On "
        "average over such units, Bayes' rule from the diagnoses is therefore the best possible prediction "
        "without knowledge of the unit's own laws. The difference between it and the clairvoyant predictions "
        "cannot be learnt from a fleet of any size."
    )


def _ratio(ours: float, best: float) -> str:
    """Return `ours` relative to `best` in percent."""
    return "–" if best == 0 else f"{100 * ours / best:.0f} %"


def _shortfalls(units: Units) -> Iterator[str]:
    """Yield the requirements that are not met on the diagnosed recordings."""
    unmet = []
    for share in (0.5, 0.75):
        ours = scores(units, WITH_FLEET, share)
        best = [scores(units, way, share).alpha_lambda for way in CLAIRVOYANTS]
        if ours.alpha_lambda < REQUIRED_SHARE * max(best):
            parts = " and ".join(_ratio(ours.alpha_lambda, reference) for reference in best)
            unmet.append(f"alpha-lambda at λ = {share:g} ({parts} of the clairvoyants')")
        if not REQUIRED_COVERAGE[0] <= (ours.coverage or 0) <= REQUIRED_COVERAGE[1]:
            unmet.append(f"coverage at λ = {share:g} ({100 * (ours.coverage or 0):.0f} %)")
    in_time = share_in_time(units, WITH_FLEET)
    if in_time < REQUIRED_WARNED:
        unmet.append(f"warnings in time ({100 * in_time:.1f} %)")
    yield f"\n**Not met**: {', '.join(unmet)}." if unmet else "\nAll requirements are met."


def _tables(title: str, units: Units) -> Iterator[str]:
    yield f"\n### {title}\n"
    for share in SHARES:
        time = "the first diagnosis" if share == 0 else f"λ = {share:g}"
        yield f"\nAt {time}, {len(units)} synthetic units:\n"
        yield markdown_table(HEADER, [(way, *scores(units, way, share).row) for way in ways(units)])
    yield (
        "\n*Mean life*: the mean over the other units that have lived longer. *Last slope*: a straight line "
        "through the last ten diagnoses of each component. *One filter a component*: a Kalman filter of "
        "level and rate for each component, without covariances between them, in the manner of `progpy`. A "
        "prediction of one number has no interval; its CRPS is its absolute error. A prediction without "
        "failure counts as 20,000 h.\n"
    )


def _new_unit(units: Units) -> Iterator[str]:
    ours, alone = (scores(units, way, 0.0) for way in (WITH_FLEET, ALONE))
    yield (
        "The first RUL of a unit, from one diagnosis: with the fleet's prior the CRPS is "
        f"{ours.crps:,.0f} h, and the 90 % interval is {ours.width:.1f} times as wide as the true RUL and "
        f"contains {100 * (ours.coverage or 0):.0f} % of the true values; without it, {alone.crps:,.0f} h, "
        f"{alone.width:.1f} times, and {100 * (alone.coverage or 0):.0f} %."
    )


def _by_law(units: Units) -> str:
    rows = []
    for law, count in Counter(unit["law"] for unit in units).most_common():
        chosen = [unit for unit in units if unit["law"] == law]
        cells: list[str] = []
        for share in (0.5, 0.75):
            ways = (WITH_FLEET, *CLAIRVOYANTS, INFORMED)
            cells += [f"{scores(chosen, way, share).alpha_lambda:.2f}" for way in ways]
            transforms = [unit["ways"][WITH_FLEET][str(share)]["transform"] for unit in chosen]
            cells.append(f"{100 * coverage(transforms):.0f} %")
        name = law if LAWS[law].known else f"{law} (unknown to the filter)"
        rows.append((name, str(count), *cells))
    header = (
        "law of the failed component",
        "units",
        "alpha-lambda, λ = 0.5",
        *CLAIRVOYANTS,
        "Bayes' rule",
        "coverage",
        "λ = 0.75",
        *CLAIRVOYANTS,
        "Bayes' rule",
        "coverage",
    )
    return markdown_table(header, rows)


def _population(population: Population) -> Iterator[str]:
    rows = [
        (
            name,
            ", ".join(f"{law} {100 * share:.0f} %" for law, share in wear.laws.items()),
            f"{100 * wear.share:.0f} %",
            f"{wear.life:,.0f} h",
            f"{wear.spread:g}",
            f"{wear.limit:g}",
        )
        for name, wear in population.wear.items()
    ]
    header = ("component", "laws", "of the units", "median life", "spread (log)", "limit")
    yield markdown_table(header, rows)
    s = population.stress
    yield (
        f"\nThe median life is the time until the component reaches its limit, under nominal stress. A unit "
        f"ages 2^(ΔT/{s.doubling:g} K) (1 + l)^3 times as fast. Its mission has standard deviations of "
        f"{s.mission_K:g} K in ΔT and {s.mission_load:g} in l; each interval between two check flights adds "
        f"{s.flight_K:g} K and {s.flight_load:g}. The load and the temperature of each interval are "
        "recorded, as an operator can; the simple alternatives do not use them. The laws and the "
        "ranges of their parameters are in `src/emaphm/fleet/synthetic/growth.py`, the numbers above in "
        "`population.py` of that folder. They were chosen before any prediction on them; the prognosis was "
        "developed on another fleet (`--population development`). Two settings, however, were chosen on "
        "further units drawn from this population, so that intervals contain the truth: the share of the "
        "filter in a forecast, and that the forecast uses the filter alone where a unit has passed no step."
    )


def write_fleet_page(studies: str | Path, folder: str | Path, units: int = PLAN.units) -> Path:
    """Write ``fleet.md`` and its figures to `folder` from the results in `studies`, and return its path.

    `units` is the number of units of the study.
    """
    place, out = StudyFolder(Path(studies), units), Path(folder)
    fleet = recorded_fleet(place)
    drawn = (drawn_unit(MANY, i) for i in range(FLEET_UNITS, FLEET_UNITS + JUDGED))
    failed = [unit for unit in (*(member for member, _ in fleet), *drawn) if unit.failure is not None]
    page, figures = fleet_page(results(place), len(failed), quality(fleet), "fleet", units)
    make_folder(out / "fleet")
    for name, picture in figures.items():
        with written_whole(out / "fleet" / f"{name}.svg") as temporary:
            temporary.write_bytes(picture)
    with written_whole(out / "fleet.md") as temporary:
        temporary.write_text(page, encoding="utf-8")
    return out / "fleet.md"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m emaphm.report.fleet.page")
    parser.add_argument("studies", help="folder of the study")
    parser.add_argument("folder", help="folder in which the page is written")
    parser.add_argument("--units", type=int, default=PLAN.units, help="number of units of the study")
    arguments = parser.parse_args()
    try:
        write_fleet_page(arguments.studies, arguments.folder, arguments.units)
    except EmaphmError as error:
        sys.exit(f"error: {error}")
