"""Writing of the special page of a study, with its figures."""

from pathlib import Path

from emaphm.output_files import make_folder, written_whole
from emaphm.report.accuracy_page import accuracy_page
from emaphm.report.drive_page import HEADINGS, drive_page
from emaphm.report.limits_page import limits_page
from emaphm.study.store import Store


def write_study_page(store: Store, folder: str | Path) -> list[Path]:
    """Write ``<page>.md`` to `folder`, and its figures to ``<page>/``; return their paths.

    Raises
    ------
    StudyError
        A row of the page has no finished trial yet, or the plan lacks data that the page needs.
    OutputError
        A file cannot be written.
    """
    folder, plan = Path(folder), store.plan
    figures: dict[str, bytes] = {}
    if plan.page == "accuracy":
        page = accuracy_page(plan, store.results)
    elif plan.page in HEADINGS:
        page = drive_page(plan, store.results)
    else:
        page, figures = limits_page(plan, store.results, str(plan.page))
    contents = {
        folder / f"{plan.page}.md": page.encode(),
        **{folder / str(plan.page) / f"{name}.svg": content for name, content in figures.items()},
    }
    for path, content in contents.items():
        make_folder(path.parent)
        with written_whole(path) as temporary:
            temporary.write_bytes(content)
    return list(contents)
