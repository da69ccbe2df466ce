"""The report of a study: Markdown, CSV and HTML agree, are self-contained, and can be replaced."""

import base64
import re
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree as ET

import matplotlib as mpl
import polars as pl
import pytest
from matplotlib.figure import Figure

import emaphm.report.study
from emaphm.errors import OutputError
from emaphm.report.document import escaped
from emaphm.report.study import write_study_report
from emaphm.study.analysis.tables import MOST_CASES

from .conftest import CASES, METHODS, study

ENVIRONMENT = {"Machine": "2 cores", "Python": "3.11"}

HOSTILE = """<script src="http://bad.example/x.js">|a_b_ *c* `d` [e](http://bad.example) $f$ & \\g"""

Cells = list[list[str]]


class Page(HTMLParser):
    """Parsed page: tables, open tags, addresses, and the text with single blanks."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.open: list[str] = []
        self.addresses: list[str] = []
        self.tables: list[Cells] = []
        self._text: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))
        self.close()
        assert not self.open
        self.text = " ".join("".join(self._text).split())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Store a tag as open, unless it is a void element, and begin tables, rows and cells."""
        self.tags.append(tag)
        if tag not in ("meta", "img"):
            self.open.append(tag)
        self.addresses += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "data")]
        if tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("th", "td"):
            self.tables[-1][-1].append("")

    def handle_endtag(self, tag: str) -> None:
        """Check that a tag closes the last opened tag."""
        assert self.open.pop() == tag, f"</{tag}> closes something else"

    def handle_data(self, data: str) -> None:
        """Store text."""
        if self.open[-1:] != ["style"]:
            self._text.append(data)
        if self.open[-1:] in (["th"], ["td"]):
            self.tables[-1][-1][-1] += data


def _markdown_tables(path: Path) -> list[Cells]:
    """Return the cells of each Markdown table, without backslashes."""
    tables: list[Cells] = []
    inside = False
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("| "):
            inside = False
            continue
        if not inside:
            tables.append([])
            inside = True
        cells = [re.sub(r"\\(.)", r"\1", cell.strip()) for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if set(cells[0]) != {"-"}:
            tables[-1].append(cells)
    return tables


def _csv(folder: Path, name: str) -> list[dict[str, object]]:
    return list(pl.read_csv(folder / "tables" / f"{name}.csv").iter_rows(named=True))


def _write(runs: pl.DataFrame, folder: Path, total: int | None = None, title: str = "thesis") -> list[Path]:
    return write_study_report(
        runs, title, "Ten faults.", folder, runs.height if total is None else total, ENVIRONMENT
    )


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the figures empty for tests that check only the text, because drawing takes long."""
    for part in ("costs", "errors", "success", "convergence", "ranks"):
        monkeypatch.setattr(emaphm.report.study, f"draw_{part}", lambda *_: Figure())
    monkeypatch.setattr(emaphm.report.study, "svg", lambda _: b"<svg/>")


@pytest.fixture(scope="session")
def report_folder(runs: pl.DataFrame, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the report of the complete study."""
    folder = tmp_path_factory.mktemp("whole") / "report"
    paths = _write(runs, folder)
    assert sorted(paths) == sorted(path for path in folder.rglob("*") if path.is_file())
    return folder


def test_the_page_is_well_formed_and_self_contained(report_folder: Path) -> None:
    page = Page(report_folder / "report.html")
    assert "script" not in page.tags
    assert "link" not in page.tags
    assert len(page.addresses) == 5
    for address in page.addresses:
        kind, encoded = address.split(",", 1)
        assert kind == "data:image/svg+xml;base64"
        assert ET.fromstring(base64.b64decode(encoded, validate=True)).tag.endswith("svg")  # noqa: S314 - made by this test
    source = (report_folder / "report.html").read_text(encoding="utf-8")
    assert "url(" not in source
    assert "@import" not in source
    assert "http" not in re.sub(r'src="data:[^"]*"', "", source).replace("http-equiv", "")


def test_the_page_is_small_enough_for_mail(report_folder: Path) -> None:
    assert (report_folder / "report.html").stat().st_size < 1_500_000


def test_markdown_links_to_existing_figures_that_are_in_the_page(report_folder: Path) -> None:
    linked = re.findall(
        r"!\[[^\]]+\]\((figures/[^)]+)\)", (report_folder / "report.md").read_text(encoding="utf-8")
    )
    assert sorted(linked) == sorted(f"figures/{path.name}" for path in (report_folder / "figures").iterdir())
    inside = [
        base64.b64decode(address.split(",", 1)[1])
        for address in Page(report_folder / "report.html").addresses
    ]
    assert inside == [(report_folder / link).read_bytes() for link in linked]


def test_markdown_and_page_have_the_same_tables(report_folder: Path) -> None:
    tables = _markdown_tables(report_folder / "report.md")
    assert len(tables) == 8
    assert Page(report_folder / "report.html").tables == tables


def test_all_figures_have_a_caption(report_folder: Path) -> None:
    page = Page(report_folder / "report.html")
    assert page.tags.count("figcaption") == page.tags.count("figure") == 5


def test_the_errors_in_the_tables_are_those_of_the_csv(report_folder: Path) -> None:
    tables = {table[0][0]: table for table in _markdown_tables(report_folder / "report.md")[2:3]}
    header, *rows = tables["case"]
    assert header[1:] == list(METHODS)
    printed = {
        (row[0], method): cell for row in rows for method, cell in zip(header[1:], row[1:], strict=True)
    }
    errors = _csv(report_folder, "errors")
    assert len(errors) == len(CASES) * len(METHODS)
    for row in errors:
        ours, *thesis = printed[str(row["case"]), str(row["method"])].split(" / ")
        assert ours == f"{row['mean']:.2f}"
        assert thesis == ([] if row["thesis"] is None else [f"{row['thesis']:.2f}"])
    for row in _csv(report_folder, "summary"):
        if row["kind"] == "single faults":
            average = printed["Average of 10 cases, single faults", str(row["method"])]
            assert average.split(" / ")[0] == f"{row['mean']:.2f}"


def test_the_other_tables_are_those_of_the_csv(report_folder: Path) -> None:
    single, several, _, success, times, reliability, ranks, pairs = _markdown_tables(
        report_folder / "report.md"
    )
    summary = {(str(row["kind"]), str(row["method"])): row for row in _csv(report_folder, "summary")}
    for kind, table in (("single faults", single), ("several faults", several)):
        assert len(table) == 1 + len(METHODS)
        assert [float(row[1]) for row in table[1:]] == sorted(float(row[1]) for row in table[1:])
        for name, mean, interval, median, worst, _, evaluations, _, seconds, count in table[1:]:
            row = summary[kind, name]
            assert [mean, median, worst] == [f"{row[key]:.2f}" for key in ("mean", "median", "worst")]
            assert interval == f"{row['lower95']:.2f} to {row['upper95']:.2f}"
            assert [evaluations, seconds, count] == [
                f"{row['evaluations']:.0f}",
                f"{row['seconds']:.2f}",
                f"{row['runs']}",
            ]
    shares = {(str(row["kind"]), str(row["method"])): row for row in _csv(report_folder, "success")}
    for name, *cells in success[1:]:
        expected = [
            f"{100 * shares[kind, name][f'within_{limit}']:.0f}"  # type: ignore[operator]
            for kind in ("single faults", "several faults")
            for limit in (1, 2, 5)
        ]
        assert cells == expected
    by_case = {
        (str(row["case"]), str(row["method"])): row["mean_seconds"] for row in _csv(report_folder, "times")
    }
    for name, *cells in times[1 : 1 + len(CASES)]:
        assert [cell.split(" / ")[0] for cell in cells] == [
            f"{by_case[name, method]:.2f}" for method in times[0][1:]
        ]
    assert times[1][1].endswith(" / 2549")  # GA, low F
    assert times[-1][1].endswith(" / 2786")  # and its printed average
    for row in _csv(report_folder, "reliability"):
        cells = next(cells for name, *cells in reliability if name == row["method"])
        keys = ("all_methods", "thesis_methods", "thesis_recomputed", "thesis_printed")
        assert cells == ["–" if row[key] is None else f"{row[key]:.1f}" for key in keys]
    by_name = {row["method"]: f"{row['mean_rank']:.2f}" for row in _csv(report_folder, "ranks")}
    assert {row[0]: row[1] for row in ranks[1:]} == by_name
    p_values = {
        (row[0], other): cell for row in pairs[1:] for other, cell in zip(pairs[0][1:], row[1:], strict=True)
    }
    for row in _csv(report_folder, "pairs"):
        p = row["p_holm"]
        assert isinstance(p, float)
        text = "<0.001" if p < 0.001 else f"{p:.3f}"
        assert p_values[str(row["method"]), str(row["other"])] == text
        assert p_values[str(row["other"]), str(row["method"])] == text


def test_the_table_of_runs_leaves_out_list_columns(runs: pl.DataFrame, report_folder: Path) -> None:
    table = pl.read_csv(report_folder / "tables" / "runs.csv")
    assert table.height == runs.height
    assert table["error_percent"].to_list() == runs["error_percent"].to_list()
    assert not {"truth", "found", "curve_fitness"} & set(table.columns)


def test_the_report_states_the_plan_the_results_and_the_method(report_folder: Path) -> None:
    text = Page(report_folder / "report.html").text
    for statement in (
        "thesis Ten faults.",
        "990 of 990 runs are finished",
        "averaged model, fitness least_squares, equivalent current torque, 0 A noise",
        "while other runs used the same machine",
        "All methods have finished 110 pairs of case and seed.",
        "the methods differ significantly",
        "the method with the lower mean rank is then better. p-value",
        "Machine 2 cores",
        "emaphm 9.8.7",
        "0123456789ab",
    ):
        assert statement in text


def test_the_same_runs_in_any_order_and_style_give_the_same_bytes(tmp_path: Path) -> None:
    runs = study(("GA", "hybrid"), ("low F", "low B"), 6)
    first = _write(runs, tmp_path / "a")
    with mpl.rc_context({"figure.facecolor": "black", "font.size": 20, "svg.fonttype": "none"}):
        second = _write(runs.sample(fraction=1, shuffle=True, seed=2), tmp_path / "b")
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]


@pytest.mark.usefixtures("undrawn")
def test_an_incomplete_study_is_named_so_and_averages_use_only_common_cases(
    runs: pl.DataFrame, tmp_path: Path
) -> None:
    _write(runs.head(60), tmp_path, runs.height)
    text = Page(tmp_path / "report.html").text
    assert "60 of 990 runs are finished" in text
    # Six cases of all nine methods, and low K by six methods.
    assert "leave out 6 of 60 runs whose case and seed a method lacks, and with them all of ‘low K’," in text
    assert "Average of 6 cases, single faults" in text
    errors = _markdown_tables(tmp_path / "report.md")[1]
    assert "–" in next(row for row in errors if row[0] == "low K")


@pytest.mark.usefixtures("undrawn")
def test_the_report_states_that_results_of_several_versions_are_mixed(tmp_path: Path) -> None:
    runs = study(("GA", "DE"), ("low F",), 2, revision="new")
    _write(pl.concat([runs.head(1).with_columns(revision=pl.lit("old")), runs.tail(3)]), tmp_path)
    assert (
        "> **Results of 2 versions of the models are mixed: new, old." in (tmp_path / "report.md").read_text()
    )


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    ("count", "told"), [(0, "there are no results yet"), (1, "1 of 990 runs are finished")]
)
def test_no_run_and_one_run_can_be_reported(
    runs: pl.DataFrame, tmp_path: Path, count: int, told: str
) -> None:
    _write(runs.head(count), tmp_path, runs.height)
    assert told in Page(tmp_path / "report.html").text
    assert len(_csv(tmp_path, "runs")) == count
    assert "Are the differences significant?" not in Page(tmp_path / "report.html").text


@pytest.mark.usefixtures("undrawn")
def test_the_report_states_that_there_are_too_few_runs(tmp_path: Path) -> None:
    _write(study(("GA", "DE", "hybrid"), ("low F",), 4), tmp_path)
    text = Page(tmp_path / "report.html").text
    assert "All methods have finished 4 pairs of case and seed. This is not enough" in text
    assert "no difference can be significant" in text
    pairs = _markdown_tables(tmp_path / "report.md")[-1]
    assert {cell for row in pairs[1:] for cell in row[1:]} == {"–", "too few"}


@pytest.mark.usefixtures("undrawn")
def test_methods_missing_in_the_thesis_are_not_compared_with_it(tmp_path: Path) -> None:
    _write(study(("hybrid", "random"), ("low F", "low B"), 6), tmp_path)
    text = Page(tmp_path / "report.html").text
    assert "Hollow markers" not in text
    assert "printed" not in text
    tables = _markdown_tables(tmp_path / "report.md")
    assert not [cell for table in tables for row in table for cell in row if " / " in cell]


@pytest.mark.usefixtures("undrawn")
def test_each_variant_has_a_section_and_a_table_compares_all(variants: pl.DataFrame, tmp_path: Path) -> None:
    _write(variants, tmp_path)
    markdown = (tmp_path / "report.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## (.*)$", markdown, re.MULTILINE)
    assert headings[:3] == ["Comparison of the variants", "0 A noise", "0.1 A noise"]
    beside = _markdown_tables(tmp_path / "report.md")[0]
    assert beside[0] == ["method", "0 A noise", "0.1 A noise"]
    for name, *cells in beside[1:]:
        expected = {
            str(row["noise_A"]): f"{row['mean']:.2f}"
            for row in _csv(tmp_path, "summary")
            if row["method"] == name and row["kind"] == "single faults"
        }
        assert cells == [expected["0.0"], expected["0.1"]]
    assert Page(tmp_path / "report.html").tables == _markdown_tables(tmp_path / "report.md")
    names = {path.name for path in (tmp_path / "figures").iterdir()}
    assert {"errors-1.svg", "errors-2.svg"} <= names
    assert all(f"figures/{name}" in markdown for name in names)


@pytest.mark.usefixtures("undrawn")
def test_the_page_lists_some_of_hundreds_of_cases_and_the_csv_all(tmp_path: Path) -> None:
    runs = study(("GA",), ("low F",), 200)
    many = runs.with_columns(pl.format("random {}", "run").alias("case"))
    _write(many, tmp_path)
    errors = _markdown_tables(tmp_path / "report.md")[1]
    assert len(errors) == 1 + MOST_CASES + 1  # header, cases, average
    assert f"The first {MOST_CASES} of 200 cases" in Page(tmp_path / "report.html").text
    assert len(_csv(tmp_path, "errors")) == 200


@pytest.mark.usefixtures("undrawn")
def test_names_with_markup_are_printed_as_text(tmp_path: Path) -> None:
    runs = study((HOSTILE, "_x_", "two\nlines"), ("low F", "low B"), 6)
    write_study_report(runs, HOSTILE, "1. " + HOSTILE, tmp_path, runs.height, {HOSTILE: HOSTILE})
    page = Page(tmp_path / "report.html")
    assert "script" not in page.tags
    assert not [address for address in page.addresses if not address.startswith("data:")]
    assert page.text.count(HOSTILE) > 5
    tables = _markdown_tables(tmp_path / "report.md")
    assert {row[0] for row in tables[0][1:]} == {HOSTILE, "_x_", "two lines"}
    assert [[[" ".join(cell.split()) for cell in row] for row in table] for table in page.tables] == tables
    markdown = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert not re.search(r"(?<!\\)<", markdown)
    assert not re.search(r"(?<![\\!])\[", markdown)
    assert "\n1\\. " in markdown


@pytest.mark.parametrize("text", ["- a", "+ a", "= a", "3) a", "# a", "a\n\n- b"])
def test_text_that_begins_like_markup_is_printed_as_text(text: str) -> None:
    line = escaped(text)
    assert "\n" not in line
    assert not re.match(r"[-+=#]|\d+[.)]", line)
    assert re.sub(r"\\(.)", r"\1", line) == " ".join(text.split())


@pytest.mark.usefixtures("undrawn")
def test_a_name_that_is_not_valid_text_is_printed(tmp_path: Path) -> None:
    _write(study(("GA",), ("low F",), 1), tmp_path, title="rec\udcff")
    assert "rec?" in Page(tmp_path / "report.html").text


@pytest.mark.usefixtures("undrawn")
def test_an_earlier_report_is_replaced_and_other_files_are_kept(tmp_path: Path) -> None:
    mine = tmp_path / "figures" / "mine.txt"
    _write(study(("GA",), ("low F",), 1), tmp_path, 4)
    mine.write_text("mine", encoding="utf-8")
    _write(study(("GA",), ("low F",), 4), tmp_path)
    assert "4 of 4 runs are finished" in Page(tmp_path / "report.html").text
    assert mine.read_text(encoding="utf-8") == "mine"
    assert not [path for path in tmp_path.rglob("*") if path.name.endswith(".tmp")]


@pytest.mark.usefixtures("undrawn")
def test_an_error_leaves_the_earlier_file_unchanged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _write(study(("GA",), ("low F",), 1), tmp_path)
    contents_before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}

    def fails(self: Path, _: bytes) -> int:
        self.touch()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", fails)
    with pytest.raises(OutputError, match="No space left"):
        _write(study(("GA",), ("low F",), 2), tmp_path)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == contents_before


@pytest.mark.usefixtures("undrawn")
def test_an_impossible_folder_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match=re.escape(str(tmp_path / "file"))) as caught:
        _write(study(("GA",), ("low F",), 1), tmp_path / "file" / "report")
    assert "\n" not in str(caught.value)
