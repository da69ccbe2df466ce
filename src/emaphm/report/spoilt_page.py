"""The page of the spoilt recordings: outcomes of each class, and each undetected error.

    python -m emaphm.report.spoilt_page studies/spoilt docs

reads the results of `python -m emaphm.study.spoilt studies/spoilt`, and writes ``spoilt.md``.
"""

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

from emaphm.diagnosis.error_metric import WRONG_ERROR, WRONG_HALF_WIDTHS
from emaphm.errors import EmaphmError, StudyError
from emaphm.output_files import make_folder, written_whole
from emaphm.report.markdown import incomplete
from emaphm.study.spoilt.judging import OUTCOME_TITLES
from emaphm.study.spoilt.rates import Results, rows, undetected_errors
from emaphm.study.spoilt.run import cases, class_of, results
from emaphm.study.spoilt.source import ADC_BITS, CHANNELS, FAULTS, NOISE_A
from emaphm.text_table import markdown_table


def spoilt_page(results_by_case: Results, total: int) -> str:
    """Return the page as Markdown, from the results `results_by_case` of `total` cases."""
    return (
        "\n".join(
            [
                "# Spoilt recordings\n",
                *incomplete(len(results_by_case), total),
                *_introduction(results_by_case),
                markdown_table(["class", "cases", *OUTCOME_TITLES], rows(results_by_case)),
                "\n## Undetected errors\n",
                *_undetected_errors(results_by_case),
                "\n## Reasons for recordings that are not explained or refused\n",
                *_reasons(results_by_case),
            ]
        )
        + "\n"
    )


def _introduction(results_by_case: Results) -> Iterator[str]:
    spoilt = [case for case in results_by_case if not class_of(case).control]
    yield (
        "Made by `python -m emaphm.study.spoilt studies/spoilt` and `python -m emaphm.report.spoilt_page "
        f"studies/spoilt docs`. {len(spoilt)} recordings of the thesis's actuator by the reference model "
        f"({NOISE_A:g} A of noise, {ADC_BITS} bits), each spoilt in one way, are diagnosed without "
        f"information on the spoiling, with {len(FAULTS)} sets of true faults ({', '.join(FAULTS)}). The "
        "recorded channels are "
        + "; ".join(f"*{name}*: {', '.join(channels)}" for name, channels in CHANNELS.items())
        + ". The first row is the control, which is not spoilt.\n"
    )
    yield (
        "*Refused*: an error message. *Not explained*: the diagnosis reports that the model does not explain "
        "the recording, and gives no verdict. *Cannot tell*: explained, without a definite verdict. *Right*: "
        "explained, with correct definite verdicts; the spoiling was corrected or harmless. "
        "*Undetected error*: explained, and the estimate of a component that is called healthy or degraded "
        f"has an error of more than {WRONG_ERROR:g} and of more than {WRONG_HALF_WIDTHS:g} half-widths of "
        "its interval.\n"
    )


def _undetected_errors(results_by_case: Results) -> Iterator[str]:
    wrong_cases = undetected_errors(results_by_case)
    if not wrong_cases:
        yield "None."
    for case, result in wrong_cases:
        residual = 100 * result["relative_residual"]
        yield f"- {case.name}: {', '.join(result['wrong'])}; residual {residual:.1f} %"


def _reasons(results_by_case: Results) -> Iterator[str]:
    """Yield one line per class: the first reason, or the message of the refusal."""
    listed: set[str] = set()
    for case, result in results_by_case.items():
        text = result["refusal"] or next(iter(result["reasons"]), "")
        if text and case.spoilt_class not in listed:
            listed.add(case.spoilt_class)
            yield f"- {case.spoilt_class} ({case.channels}): {text}"


def write_spoilt_page(studies: str | Path, folder: str | Path) -> Path:
    """Write ``spoilt.md`` to `folder` from the results in `studies`, and return its path.

    `StudyError` if `studies` has no results of this version of the models: an existing page stays.
    """
    chosen = cases()
    finished = results(studies, chosen)
    if not finished:
        raise StudyError(
            f"{studies}: no results of this version of the models; compute them with "
            f"'python -m emaphm.study.spoilt {studies}'"
        )
    page = spoilt_page(finished, len(chosen))
    make_folder(Path(folder))
    path = Path(folder) / "spoilt.md"
    with written_whole(path) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return path


def main() -> None:
    """Write the page for the arguments of the command line."""
    parser = argparse.ArgumentParser(prog="python -m emaphm.report.spoilt_page", description=__doc__)
    parser.add_argument("studies", help="folder with the results of 'python -m emaphm.study.spoilt'")
    parser.add_argument("folder", help="folder in which spoilt.md is written")
    arguments = parser.parse_args()
    write_spoilt_page(arguments.studies, arguments.folder)


if __name__ == "__main__":
    try:
        main()
    except EmaphmError as error:
        sys.exit(f"error: {error}")
