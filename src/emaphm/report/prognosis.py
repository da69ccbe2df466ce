"""Report of a prognosis as one HTML page."""

from pathlib import Path

from emaphm.output_files import check_writable, written_whole
from emaphm.plotting.prognosis import draw_fan, draw_health, draw_life
from emaphm.plotting.svg import plain_style, svg
from emaphm.prognosis.evidence import Evidence
from emaphm.prognosis.keeping.curves import Curves, fan_row
from emaphm.prognosis.prognose import past_rul_forecasts
from emaphm.prognosis.result import Prognosis
from emaphm.prognosis.wording.sentences import advice_text
from emaphm.prognosis.wording.tables import level_table, requirement_table
from emaphm.report.document import Block, Document, Facts, Heading, Items, Paragraph, Picture


def write_prognosis(prognosis: Prognosis, path: str | Path, *, force: bool = False) -> None:
    """Write `prognosis` as one self-contained HTML file; the same prognosis gives the same bytes.

    Raises
    ------
    OutputError
        See `emaphm.output_files.check_writable`; also if writing fails, and then no file is left.
    """
    check_writable(path, force=force, endings=(".html", ".htm"))
    page = document(prognosis).to_html()
    with written_whole(path) as temporary:
        temporary.write_text(page, encoding="utf-8", errors="replace")


def document(prognosis: Prognosis) -> Document:
    """Return the report as a document."""
    evidence = prognosis.evidence
    longest = float(prognosis.paths.hours[-1])
    past = [fan_row(hours, sample, longest) for hours, sample in past_rul_forecasts(prognosis)]
    curves = Curves.of(prognosis, past)
    with plain_style():
        health, life = svg(draw_health(curves)), svg(draw_life(curves))
        fan = svg(draw_fan(curves)) if past else None
    horizon = f"{prognosis.horizon:.9g} h"
    advice = advice_text(prognosis.advice, evidence.hours)
    none = "nothing in sight" if evidence.unrepaired is None else "not found"
    blocks: list[Block] = [
        Paragraph(_sentence(advice), warning=prognosis.advice.action != "fly on"),
        Facts(
            {
                "Remaining useful life": prognosis.rul_text(),
                f"Probability of failure within {horizon}": f"{100 * prognosis.probability_of_failure:.1f} %",
                "Fails first": prognosis.limit.label if prognosis.limit else none,
                "Component responsible": prognosis.component or none,
                "Diagnoses": _diagnoses(evidence),
                "Prior": f"{prognosis.belief.prior.units} other units of the part number",
                "Seed": str(prognosis.seed),
            }
        ),
        *([Items(tuple(map(_sentence, prognosis.notes)))] if prognosis.notes else []),
        Heading(2, "Health over time"),
        Picture(
            "health.svg",
            "Level of each component over flight hours, with bands of the forecast and limits",
            "Levels from 0 to 1: diagnoses with 90 % intervals, forecast with bands of 50 and 90 %, limits.",
            health,
        ),
        Heading(2, "Remaining useful life"),
        Picture(
            "life.svg",
            "Probability of failure over flight hours",
            "Probability that a requirement has failed by then.",
            life,
        ),
    ]
    if fan is not None:
        blocks.append(
            Picture(
                "fan.svg",
                "Fan chart of the remaining useful life",
                "RUL as forecast at earlier diagnoses, from the data known at that time.",
                fan,
            )
        )
    blocks += [
        Heading(2, "Requirements"),
        requirement_table(prognosis.requirements(), prognosis.horizon),
        Heading(2, "Levels"),
        level_table(prognosis.levels()),
    ]
    subtitle = f"Prognosis of an electromechanical actuator, part number {evidence.part_number}"
    return Document(f"{evidence.unit} at {round(evidence.hours, 2):,.12g} h", subtitle, tuple(blocks))


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."


def _diagnoses(evidence: Evidence) -> str:
    newest = "" if evidence.unexplained is None else "; the newest recording is not explained"
    return f"{len(evidence.used)} used of {len(evidence.observations)}{newest}"
