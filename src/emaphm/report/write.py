"""Writing of the report of a diagnosis."""

from pathlib import Path, PureWindowsPath
from typing import TYPE_CHECKING

from emaphm.actuator import Faults
from emaphm.actuator.toml import write_toml
from emaphm.diagnosis.error_metric import error_percent
from emaphm.diagnosis.result import Diagnosis
from emaphm.diagnosis.verdict import VERDICT
from emaphm.output_files import check_writable, written_whole
from emaphm.plotting.diagnosis import draw_fit, draw_residual
from emaphm.plotting.external_load import draw_external_load
from emaphm.plotting.fault_intervals import draw_faults
from emaphm.plotting.posterior import draw_posterior
from emaphm.plotting.svg import plain_style, svg, svg_uri
from emaphm.report.page import render
from emaphm.report.wording import component_table, computation, headline, inconclusive

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TEMPLATE = "diagnosis.html.jinja"


def write_report(
    diagnosis: Diagnosis, path: str | Path, *, truth: Faults | None = None, force: bool = False
) -> None:
    """Write `diagnosis` as one self-contained HTML file with embedded figures and style.

    The same diagnosis gives the same bytes.

    Parameters
    ----------
    path
        An .html or .htm file.
    truth
        The true faults, shown next to the estimates, if they are known.
    force
        Whether an existing file may be replaced.

    Raises
    ------
    OutputError
        See `emaphm.output_files.check_writable`; also if writing fails, and then no file is left.
    """
    check_writable(path, force=force, endings=(".html", ".htm"))
    page = _page(diagnosis, truth)
    with written_whole(path) as temporary:
        # A recording's name may be invalid text: characters that cannot be encoded become question marks.
        temporary.write_text(page, encoding="utf-8", errors="replace")


def _page(diagnosis: Diagnosis, truth: Faults | None) -> str:
    with plain_style():
        figures = {
            "faults": _embedded(draw_faults(diagnosis, truth)),
            "fit": _embedded(draw_fit(diagnosis)),
            "residual": _embedded(draw_residual(diagnosis)),
        }
        if diagnosis.load:
            figures["load"] = _embedded(draw_external_load(diagnosis))
        if diagnosis.posterior:
            figures["posterior"] = _embedded(draw_posterior(diagnosis))
    error = None if truth is None else float(error_percent(truth.vector, diagnosis.faults.vector))
    return render(
        TEMPLATE,
        diagnosis=diagnosis,
        # Both systems' separators are accepted: a diagnosis may be reported on another machine.
        name=PureWindowsPath(diagnosis.recording).name or diagnosis.recording,
        headline=headline(diagnosis),
        table=component_table(diagnosis, truth),
        error=error,
        figures=figures,
        inconclusive=inconclusive(diagnosis),
        notes=diagnosis.notes(),
        computation=computation(diagnosis),
        actuator=write_toml(diagnosis.actuator),
        margin=VERDICT.healthy_margin,
        hidden=VERDICT.hidden_fault,
    )


def _embedded(figure: "Figure") -> str:
    return svg_uri(svg(figure))
