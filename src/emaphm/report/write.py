"""Writing the report of a diagnosis."""

from pathlib import Path, PureWindowsPath

from emaphm.actuator import Faults
from emaphm.actuator.toml import write_toml
from emaphm.diagnosis.error_metric import error_percent
from emaphm.diagnosis.result import Diagnosis
from emaphm.diagnosis.verdict import VERDICT
from emaphm.output_files import check_writable, written_whole
from emaphm.plotting.diagnosis import draw_faults, draw_fit, draw_residual
from emaphm.plotting.posterior import draw_marginals
from emaphm.report.embed import data_uri, plain_style
from emaphm.report.page import render
from emaphm.report.wording import computation, headline, table, untold

TEMPLATE = "diagnosis.html.jinja"


def write_report(
    diagnosis: Diagnosis, path: str | Path, *, truth: Faults | None = None, force: bool = False
) -> None:
    """Write `diagnosis` as one HTML file that needs nothing else: figures and style are inside.

    The same diagnosis gives the same bytes.

    Parameters
    ----------
    path
        An .html or .htm file.
    truth
        The true faults, told and drawn beside those found where they are known.
    force
        Whether an existing file may be replaced.

    Raises
    ------
    OutputError
        See `emaphm.recording.check_writable`; also if the operating system refuses half-way, nothing
        being left then.
    """
    check_writable(path, force=force, endings=(".html", ".htm"))
    page = _page(diagnosis, truth)
    with written_whole(path) as temporary:
        # A recording's name need not be valid text: what cannot be encoded becomes a question mark.
        temporary.write_text(page, encoding="utf-8", errors="replace")


def _page(diagnosis: Diagnosis, truth: Faults | None) -> str:
    with plain_style():
        figures = {
            "faults": data_uri(draw_faults(diagnosis, truth)),
            "fit": data_uri(draw_fit(diagnosis)),
            "residual": data_uri(draw_residual(diagnosis)),
        }
        if diagnosis.posterior:
            figures["marginals"] = data_uri(draw_marginals(diagnosis))
    error = None if truth is None else float(error_percent(truth.vector, diagnosis.faults.vector))
    return render(
        TEMPLATE,
        diagnosis=diagnosis,
        # Cut at either system's separator: a diagnosis may be reported on another machine.
        name=PureWindowsPath(diagnosis.recording).name or diagnosis.recording,
        headline=headline(diagnosis),
        rows=table(diagnosis, truth),
        error=error,
        figures=figures,
        untold=untold(diagnosis),
        notes=diagnosis.notes(),
        computation=computation(diagnosis),
        actuator=write_toml(diagnosis.actuator),
        margin=VERDICT.healthy_margin,
        hidden=VERDICT.hidden_fault,
    )
