"""Figures of a study: positions and units, also with missing or zero values and unusual names."""

import sys
from collections.abc import Callable, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import polars as pl
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from emaphm.plotting.study import draw_convergence, draw_costs, draw_errors, draw_ranks, draw_success
from emaphm.plotting.study.methods import FLOOR, looks
from emaphm.plotting.study.ranks import indistinct_ranges
from emaphm.plotting.style import BLACK
from emaphm.plotting.svg import svg
from emaphm.study.analysis.statistics import by_case, by_method
from emaphm.study.analysis.tables import MOST_CASES
from emaphm.study.thesis import published

from .conftest import CASES, METHODS, study

Draw = Callable[[pl.DataFrame], Figure | None]


def _convergence(runs: pl.DataFrame) -> Figure | None:
    return draw_convergence(runs, "A²")


PARTS: tuple[Draw, ...] = (draw_errors, _convergence, draw_costs, draw_success, draw_ranks)


def _markers(
    axis: Axes, method: str, *, among: Sequence[str] = tuple(METHODS), hollow: bool = False
) -> list[tuple[float, float]]:
    """Return the points of the marker of `method`, which is one of the methods `among` in the figure."""
    look = looks(among)[method]
    lines = [
        line
        for line in axis.get_lines()
        if line.get_marker() == look.marker
        and to_hex(line.get_color()) == look.colour
        and (line.get_markerfacecolor() == "white") is hollow
    ]
    return [
        (float(np.atleast_1d(line.get_xdata())[-1]), float(np.atleast_1d(line.get_ydata())[-1]))
        for line in lines
    ]


def _legend(figure: Figure) -> list[str]:
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def _existing(figure: Figure | None) -> Figure:
    assert figure is not None
    return figure


def _settings() -> dict[str, Any]:
    return {name: mpl.rcParams[name] for name in mpl.rcParams if name != "backend"}


def test_no_two_of_many_methods_look_the_same() -> None:
    methods = [f"method {i}" for i in range(40)]
    assert len(set(looks(methods).values())) == 40


def test_errors_are_drawn_in_the_row_of_their_case_and_those_of_the_thesis_hollow(runs: pl.DataFrame) -> None:
    figure = draw_errors(runs)
    axis = figure.axes[0]
    assert [tick.get_text() for tick in axis.get_yticklabels()] == list(CASES)
    assert axis.get_xlabel() == "error [%]: median and quartiles"
    assert axis.get_xscale() == "log"
    assert axis.yaxis_inverted()
    table = by_case(runs).filter(pl.col("method") == "DE")
    points = _markers(axis, "DE")
    assert [x for x, _ in points] == table["median"].to_list()
    assert [round(y) for _, y in points] == list(range(len(CASES)))
    printed = _markers(axis, "DE", hollow=True)
    for x, y in printed:
        assert x == published.MEAN_ERROR[list(CASES)[round(y)]]["DE"]
    assert len(printed) == sum("DE" in published.MEAN_ERROR.get(case, {}) for case in CASES) >= 10
    assert not _markers(axis, "hybrid", hollow=True)
    assert _legend(figure) == [*METHODS, "printed in the thesis"]


def test_quartiles_are_drawn_as_a_line_through_the_median(runs: pl.DataFrame) -> None:
    axis = draw_errors(runs).axes[0]
    row = by_case(runs).row(by_predicate=(pl.col("method") == "GA") & (pl.col("case") == "low F"), named=True)
    ends = [row["lower_quartile"], row["upper_quartile"]]
    assert any(np.array_equal(np.asarray(line.get_xdata()), ends) for line in axis.get_lines())


def test_the_number_of_drawn_cases_is_limited_to_a_readable_number() -> None:
    few = study(("GA",), ("low F",), 40)
    many = few.with_columns(pl.format("random {}", pl.col("run").cast(pl.String).str.zfill(2)).alias("case"))
    axis = draw_errors(many).axes[0]
    assert [tick.get_text() for tick in axis.get_yticklabels()] == [
        f"random {i:02d}" for i in range(MOST_CASES)
    ]


def test_convergence_has_error_and_fitness_by_kind_and_hybrid_as_a_marker(runs: pl.DataFrame) -> None:
    figure = _existing(_convergence(runs))
    above, above_several, below, _ = figure.axes
    assert above.get_title(loc="left") == "single faults"
    assert above_several.get_title(loc="left") == "several faults"
    assert above.get_ylabel() == "error of the best so far [%]"
    assert below.get_ylabel() == "best fitness so far [A²]"
    assert below.get_xlabel() == "evaluations"
    assert (
        {axis.get_xscale() for axis in figure.axes} == {axis.get_yscale() for axis in figure.axes} == {"log"}
    )
    single = runs.filter(pl.col("case") != "multiple")
    hybrid = single.filter(pl.col("method") == "hybrid")
    ((at, error),) = _markers(above, "hybrid")
    assert at == pytest.approx(np.mean(hybrid["evaluations"].to_numpy()))
    assert error == pytest.approx(np.median(hybrid["error_percent"].to_numpy()))
    ((at, error),) = _markers(above, "GA")
    assert at == 10_000
    assert error == pytest.approx(
        np.median(single.filter(pl.col("method") == "GA")["error_percent"].to_numpy())
    )


def test_costs_show_time_and_evaluations_next_to_those_of_the_thesis(runs: pl.DataFrame) -> None:
    figure = _existing(draw_costs(runs))
    times, counts, *_ = figure.axes
    assert [axis.get_xlabel() for axis in figure.axes[-2:]] == [
        "wall time of one run [s]",
        "evaluations of one run",
    ]
    row = by_method(runs).row(
        by_predicate=(pl.col("method") == "PSO") & (pl.col("kind") == "single faults"), named=True
    )
    assert _markers(times, "PSO") == [(row["seconds"], row["mean"])]
    assert _markers(counts, "PSO") == [(10_000, row["mean"])]
    assert _markers(times, "PSO", hollow=True) == [(published.SECONDS["PSO"], published.ERROR["PSO"])]
    assert not any(_markers(axis, "PSO", hollow=True) for axis in figure.axes[1:])


def test_success_bars_are_as_long_as_their_share(runs: pl.DataFrame) -> None:
    figure = _existing(draw_success(runs))
    axis = figure.axes[0]
    assert [tick.get_text() for tick in axis.get_yticklabels()] == list(METHODS)
    assert _legend(figure) == [f"error at most {limit} %" for limit in (1, 2, 5)]
    single = runs.filter(pl.col("case") != "multiple")
    for limit, container in zip((5, 2, 1), axis.containers, strict=True):
        for method, bar in zip(METHODS, container.patches, strict=True):  # type: ignore[attr-defined]
            errors = single.filter(pl.col("method") == method)["error_percent"].to_numpy()
            assert bar.get_width() == pytest.approx(100 * np.mean(errors <= limit))


def test_ranks_are_sorted_and_bars_join_methods_that_do_not_differ() -> None:
    rng = np.random.default_rng(1)
    runs = study(("GA", "PSO", "hybrid"), ("low F",), 30)
    near = rng.uniform(5, 6, 30)
    errors = {"GA": near, "PSO": near + rng.normal(0, 0.1, 30), "hybrid": near - 4}
    values = [errors[row["method"]][row["run"]] for row in runs.iter_rows(named=True)]
    figure = draw_ranks(runs.with_columns(pl.Series("error_percent", values)))
    axis = _existing(figure).axes[0]
    names = [tick.get_text() for tick in axis.get_yticklabels()]
    assert names[0] == "hybrid"
    assert axis.texts[0].get_text() == "1.00"
    bars = [line for line in axis.get_lines() if line.get_color() == BLACK and line.get_linewidth() == 2.5]
    assert [np.round(np.asarray(bar.get_ydata())).tolist() for bar in bars] == [[1.0, 2.0]]


def test_no_bar_joins_methods_without_a_test() -> None:
    axis = _existing(draw_ranks(study(("GA", "PSO", "DE"), ("low F",), 3))).axes[0]
    assert all(line.get_linewidth() < 2.5 for line in axis.get_lines())


@pytest.mark.parametrize("draw", PARTS)
@pytest.mark.parametrize("part", ["one run", "zero errors, odd names and a method missing in a case"])
def test_incomplete_or_unusual_studies_are_drawn_without_pyplot_and_settings_unchanged(
    monkeypatch: pytest.MonkeyPatch, draw: Draw, part: str
) -> None:
    odd = ("$a^_{b$", "_x", "漢字\n" + "long " * 20)
    runs = {
        "one run": study(("GA",), ("multiple",), 1),
        "zero errors, odd names and a method missing in a case": study(odd, ("low F", "low B"), 2)
        .with_columns(
            pl.lit(0.0).alias("error_percent"),
            pl.lit(0.0).alias("fitness_value"),
            pl.col("curve_error_percent").list.eval(pl.element() * 0),
            pl.col("curve_fitness").list.eval(pl.element() * 0),
        )
        .filter((pl.col("method") != "_x") | (pl.col("case") != "low B")),
    }[part]
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)  # importing it now fails
    before = _settings()
    figure = _existing(draw(runs))
    assert b"<svg" in svg(figure)
    assert _settings() == before
    for axis in figure.axes:
        for line in axis.get_lines():
            assert np.all(np.isfinite(np.asarray(line.get_ydata(), float)))


def test_methods_without_common_cases_can_only_be_drawn_by_case(runs: pl.DataFrame) -> None:
    apart = runs.filter((pl.col("case") == "low F") == (pl.col("method") == "GA"))
    assert [draw(apart) for draw in (_convergence, draw_costs, draw_success, draw_ranks)] == [None] * 4
    assert draw_errors(apart).axes


def test_convergence_is_over_the_cases_run_by_all_methods() -> None:
    runs = study(("GA", "hybrid"), ("low F", "low B"), 4)
    lacking = runs.filter((pl.col("case") != "low B") | (pl.col("method") != "GA"))
    above = _existing(_convergence(lacking)).axes[0]
    for method in ("GA", "hybrid"):
        ((_, error),) = _markers(above, method, among=("GA", "hybrid"))
        common = [
            row["error_percent"]
            for row in runs.iter_rows(named=True)
            if (row["method"], row["case"]) == (method, "low F")
        ]
        assert error == pytest.approx(np.median(common))


def test_an_error_of_zero_is_drawn_at_the_lower_end_with_an_axis_label() -> None:
    runs = study(("GA", "hybrid"), ("low F",), 2)
    perfect = runs.with_columns(
        pl.when(pl.col("method") == "hybrid").then(0.0).otherwise("error_percent").alias("error_percent")
    )
    axis = draw_errors(perfect).axes[0]
    assert f"{FLOOR:g} or less at {FLOOR:g}" in axis.get_xlabel()
    drawn = np.concatenate([np.atleast_1d(np.asarray(line.get_xdata(), float)) for line in axis.get_lines()])
    assert drawn[drawn > 0].min() == FLOOR
    assert "or less" not in draw_errors(runs).axes[0].get_xlabel()


def test_names_are_drawn_as_text_and_shortened_if_long() -> None:
    figure = draw_errors(study(("_hidden", "$x$", "long " * 20), ("low F",), 2))
    names = _legend(figure)
    assert names[0] == "_hidden"
    assert names[1] == r"\$x\$"  # which matplotlib draws as $x$
    assert names[2].endswith("…")
    assert len(names[2]) < 30


def test_a_legend_of_many_long_names_stays_inside_the_figure() -> None:
    figure = draw_errors(study([f"a method of long name {i}" for i in range(14)], ("low F",), 1))
    figure.draw_without_rendering()
    (legend,) = figure.legends
    box = legend.get_window_extent()
    assert 0 <= box.x0 < box.x1 <= figure.bbox.x1
    assert box.y1 <= figure.bbox.y1


def test_an_initially_infinite_fitness_leaves_a_gap() -> None:
    runs = study(("GA",), ("low F",), 1)
    curve = runs["curve_fitness"][0].to_list()
    runs = runs.with_columns(pl.Series("curve_fitness", [[float("inf"), *curve[1:]]]))
    axis = _existing(_convergence(runs)).axes[1]
    line = next(line for line in axis.get_lines() if len(np.asarray(line.get_ydata())) > 1)
    evaluations, values = np.asarray(line.get_xdata()), np.asarray(line.get_ydata(), float)
    np.testing.assert_array_equal(np.isfinite(values), evaluations >= 100)  # the second population's end


def test_an_axis_of_less_than_a_decade_has_two_labelled_ticks() -> None:
    runs = study(("GA", "DE"), ("low F",), 2)
    near = runs.with_columns(
        pl.when(pl.col("method") == "GA").then(810).otherwise(1000).alias("evaluations"),
        pl.when(pl.col("method") == "GA").then(2.1).otherwise(4.2).alias("error_percent"),
    )
    figure = _existing(draw_costs(near))
    figure.draw_without_rendering()
    axis = figure.axes[1]
    low, high = axis.get_xlim()
    inside = [tick.get_text() for tick in axis.get_xticklabels() if low <= tick.get_position()[0] <= high]
    assert inside == ["900", "1,000"]


def test_no_bar_joins_methods_that_were_not_compared() -> None:
    pairs = {"method": ["A", "A", "B"], "other": ["B", "C", "C"]}
    tested = pl.DataFrame({**pairs, "p": [0.3, 0.01, None], "p_holm": [0.3, 0.02, None]})
    assert indistinct_ranges(("A", "B", "C"), tested) == [(0, 1)]
