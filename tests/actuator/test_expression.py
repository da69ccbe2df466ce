"""Arithmetic and conditions in a description, compared with Python's own; other syntax is refused."""

import numpy as np
import pytest

from emaphm.actuator.columns.expression import Expression

COLUMNS = {
    "a": np.array([1.0, 2.0, 3.0]),
    "b": np.array([2.0, 2.0, 0.0]),
    "Drive/set point": np.array([1.0, 0.0, 1.0]),
    "profile": np.array(["trap", "sin", "trap"], object),
}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a - b", [-1, 0, 3]),
        ("-a + 2 * (b - 1) / 4", [-0.5, -1.5, -3.5]),
        ("abs(b - a)", [1, 0, 3]),
        ("a / b", [0.5, 1, np.inf]),
        ("a + `Drive/set point`", [2, 2, 4]),
        ("profile == 'trap' and a > 1", [False, False, True]),
        ("not (1 < a <= 2)", [True, False, True]),
        ("not b", [False, False, True]),
        ("profile != 'trap' or a == 3", [False, True, True]),
        ("(a > 1) + (a > 2)", [0, 1, 2]),
        ("(a > 1) - (b > 1) + abs(b > 1)", [0, 1, 1]),
        ("-(a > 1)", [0, -1, -1]),
    ],
)
def test_values_agree_with_pythons_arithmetic(text: str, expected: list[float]) -> None:
    np.testing.assert_allclose(Expression.parse(text).evaluate(COLUMNS), expected)


def test_names_are_listed_in_their_order() -> None:
    assert Expression.parse("b * `Drive/set point` - a / b").names == ("b", "Drive/set point", "a")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a ** 2", "not allowed"),
        ("__import__('os').system('true')", "not allowed"),
        ("a.real", "not allowed"),
        ("a[0]", "not allowed"),
        ("max(a, b)", "not allowed"),
        ("a if b else a", "not allowed"),
        ("lambda: a", "not allowed"),
        ("a := 1", "cannot be parsed"),
        ("a -", "cannot be parsed"),
        ("", "cannot be parsed"),
        ("(" * 500 + "a" + ")" * 500, "longer than 1000"),
        ("(" * 400 + "a" + ")" * 400, "cannot be parsed"),
        ("True", "write 1 and 0"),
        ("1 + 1", "names no column"),
        ("'a' + b", "is a text"),
    ],
)
def test_disallowed_syntax_is_refused_with_a_reason(text: str, expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        Expression.parse(text)


def test_a_text_is_not_used_as_a_number() -> None:
    with pytest.raises(ValueError, match="text"):
        Expression.parse("profile < 2").evaluate(COLUMNS)


@pytest.mark.parametrize("text", ["number != 'a'", "word != 1", "word == 1", "'a' == number"])
def test_a_text_is_never_compared_with_a_number(text: str) -> None:
    with pytest.raises(ValueError, match="a text is compared"):
        Expression.parse(text).evaluate({"number": np.arange(3.0), "word": np.array(["a", "b", "a"])})


@pytest.mark.parametrize("text", ["x", "x and 1", "not not x"])
def test_any_number_but_0_is_true(text: str) -> None:
    rows = Expression.parse(text).holds({"x": np.array([2.0, -1.0, 0.0])})
    assert rows.tolist() == [True, True, False]


@pytest.mark.parametrize("text", ["x != 0", "x and y < 5", "y < 5 and x", "x == 1", "x > 0"])
def test_an_empty_cell_satisfies_no_condition(text: str) -> None:
    rows = Expression.parse(text).evaluate({"x": np.array([1.0, 0.0, np.nan]), "y": np.zeros(3)})
    assert rows.tolist() == [True, False, False]
