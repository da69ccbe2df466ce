"""Parser and evaluation of arithmetic and conditions on the columns of a file.

An expression may contain numbers, names of columns, + - * /, parentheses, abs(…), comparisons, and, or, not,
and quoted texts for comparisons. A name that is not a plain word is written between backticks: `` `Drive/set
point` ``. The text is parsed, and not evaluated as Python.
"""

import ast
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

LONGEST = 1000
"""Longest expression [characters]; the parser's stack suffices for any expression of this length."""

QUOTED_NAME = re.compile(r"`([^`]+)`")

ARITHMETIC: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}

COMPARISONS: dict[type, Callable[[Any, Any], Any]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}

ALLOWED = "numbers, names of columns, + - * /, parentheses, abs, comparisons, and, or, not"


@dataclass(frozen=True)
class Expression:
    """A parsed expression: its `text` and the `names` of its columns, in their order."""

    text: str
    names: tuple[str, ...]
    _tree: ast.expr
    _quoted: tuple[str, ...]

    @classmethod
    def parse(cls, text: str) -> "Expression":
        """Return the expression in `text`.

        Raises
        ------
        ValueError
            The text is too long, is no expression, or contains something that is not allowed, which the
            message names.
        """
        if len(text) > LONGEST:
            raise ValueError(f"is longer than {LONGEST} characters; make that column in the logger")
        quoted: list[str] = []

        def placeholder(match: re.Match[str]) -> str:
            quoted.append(match[1])
            return f" _quoted_{len(quoted) - 1}_ "

        try:
            tree = ast.parse(QUOTED_NAME.sub(placeholder, text).strip(), mode="eval").body
        except (SyntaxError, ValueError, MemoryError, RecursionError):
            raise ValueError(f"cannot be parsed; write {ALLOWED}, other names between backticks") from None
        nodes = list(_checked(tree))
        names = [_name(node, quoted) for node in nodes if isinstance(node, ast.Name)]
        if not names:
            raise ValueError("names no column; write one, or give a number as value")
        return cls(text, tuple(dict.fromkeys(names)), tree, tuple(quoted))

    def evaluate(self, columns: Mapping[str, Any]) -> Any:
        """Return the values (n,), numbers or truth values, for `columns` (n,), which include all `names`.

        A division by 0 gives an infinite value or NaN, without a warning. In arithmetic, true is 1 and false
        is 0.

        Raises
        ------
        ValueError
            A text is used in place of a number.
        """
        import numpy as np

        return self._evaluated(lambda: np.asarray(_value(self._tree, columns, self._quoted)))

    def holds(self, columns: Mapping[str, Any]) -> Any:
        """Return whether the expression is true in each row (n,): not 0 and not an empty cell.

        The argument and the error are those of `evaluate`; a text alone is also an error.
        """
        return self._evaluated(lambda: _truth(self.evaluate(columns)))

    def _evaluated(self, evaluation: Callable[[], Any]) -> Any:
        import numpy as np

        try:
            with np.errstate(all="ignore"):
                return evaluation()
        except TypeError:
            raise ValueError("a text is compared or combined with a number") from None


def _checked(node: ast.expr) -> list[ast.expr]:
    """Return a node and all nodes below it; `ValueError` if one of them is not allowed."""
    below: list[ast.expr] = []
    match node:
        case ast.Constant(value=bool()):
            raise ValueError("True and False are not known; write 1 and 0")
        case ast.Constant(value=int() | float() | str()) | ast.Name():
            pass
        case ast.BinOp(left=left, op=op, right=right) if type(op) in ARITHMETIC:
            below = [left, right]
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() | ast.Not(), operand=operand):
            below = [operand]
        case ast.Compare(left=left, ops=ops, comparators=comparators) if all(
            type(op) in COMPARISONS for op in ops
        ):
            below = [left, *comparators]
        case ast.BoolOp(values=values):
            below = values
        case ast.Call(func=ast.Name(id="abs"), args=[argument], keywords=[]):
            below = [argument]
        case _:
            raise ValueError(f"'{ast.unparse(node)}' is not allowed; write {ALLOWED}")
    for child in below:
        is_compared = isinstance(node, ast.Compare)
        if isinstance(child, ast.Constant) and isinstance(child.value, str) and not is_compared:
            raise ValueError(
                f"'{child.value}' is a text, which can only be compared; put a column's name between "
                "backticks"
            )
    return [node, *(descendant for child in below for descendant in _checked(child))]


def _name(node: ast.Name, quoted: Sequence[str]) -> str:
    """Return the column's name of a node, which is a placeholder if it was quoted."""
    match = re.fullmatch(r"_quoted_(\d+)_", node.id)
    return quoted[int(match[1])] if match and int(match[1]) < len(quoted) else node.id


def _value(node: ast.expr, columns: Mapping[str, Any], quoted: tuple[str, ...]) -> Any:
    import numpy as np

    def of(child: ast.expr) -> Any:
        return _value(child, columns, quoted)

    match node:
        case ast.Constant(value=value):
            result: Any = value if isinstance(value, str) else float(value)  # type: ignore[arg-type] # a number
        case ast.Name():
            result = columns[_name(node, quoted)]
        case ast.BinOp(left=left, op=op, right=right):
            result = ARITHMETIC[type(op)](_number(of(left)), _number(of(right)))
        case ast.UnaryOp(op=op, operand=operand):
            result = _unary(op, of(operand))
        case ast.Call(args=[argument]):
            result = np.abs(_number(of(argument)))
        case ast.BoolOp(op=op, values=values):
            truths = (_truth(of(operand)) for operand in values)
            result = reduce(np.logical_and if isinstance(op, ast.And) else np.logical_or, truths)
        case ast.Compare(left=left, ops=ops, comparators=comparators):
            sides = [of(side) for side in (left, *comparators)]
            pairs = zip(sides, ops, sides[1:], strict=False)
            result = reduce(np.logical_and, (_compared(type(op), a, b) for a, op, b in pairs))
        case _:
            raise AssertionError(node)
    return result


def _number(value: Any) -> Any:
    """Return truth values as the numbers 1 and 0, and other values unchanged.

    NumPy would add truth values as "or", and would not subtract them.
    """
    import numpy as np

    return np.asarray(value, float) if np.asarray(value).dtype == bool else value


def _truth(value: Any) -> Any:
    """Return whether values are other than 0; an empty cell is false."""
    import numpy as np

    return value if np.asarray(value).dtype == bool else (value != 0) & ~np.isnan(value)


def _compared(op: type[ast.cmpop], left: Any, right: Any) -> Any:
    """Return a comparison of two numbers or of two texts; any comparison with an empty cell is false."""
    import numpy as np

    texts = [np.asarray(side).dtype.kind in "OSU" for side in (left, right)]
    if texts[0] != texts[1]:
        raise TypeError
    result = COMPARISONS[op](left, right)
    if op is ast.NotEq and not texts[0]:
        result = result & ~(np.isnan(left) | np.isnan(right))
    return result


def _unary(op: ast.unaryop, value: Any) -> Any:
    if isinstance(op, ast.Not):
        return _compared(ast.Eq, value, 0.0)
    return -_number(value) if isinstance(op, ast.USub) else _number(value)
