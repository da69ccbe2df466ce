"""Arithmetic and conditions on the columns of a file, as an owner writes them in a description.

Allowed are numbers, names of columns, + - * /, parentheses, abs(…), comparisons, and, or, not, and texts in
quotes to compare with. A name that is no plain word stands between backticks: `` `Drive/set point` ``. The
text is parsed, never evaluated as Python.
"""

import ast
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

LONGEST = 1000
"""Longest expression [characters]; the parser's own stack holds this much of anything."""

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
    """A parsed expression: its `text` and the `names` of the columns that it needs, in their order."""

    text: str
    names: tuple[str, ...]
    _tree: ast.expr
    _quoted: tuple[str, ...]

    @classmethod
    def parse(cls, text: str) -> "Expression":
        """Return the expression that `text` holds.

        Raises
        ------
        ValueError
            It is too long, is no expression, or holds what is not allowed; the message says what.
        """
        if len(text) > LONGEST:
            raise ValueError(f"is longer than {LONGEST} characters; make that column in the logger")
        quoted: list[str] = []

        def placeholder(found: re.Match[str]) -> str:
            quoted.append(found[1])
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
        """Return the values (n,) for `columns` (n,), which hold all of `names`: numbers, or truth values.

        A quotient by 0 is infinite or no number, without a warning.

        Raises
        ------
        ValueError
            A text stands where a number is needed.
        """
        import numpy as np

        try:
            with np.errstate(all="ignore"):
                return np.asarray(_value(self._tree, columns, self._quoted))
        except TypeError:
            raise ValueError("a text is compared or reckoned with a number") from None


def _checked(node: ast.expr) -> list[ast.expr]:
    """Return a node and all below it, after seeing that each is allowed."""
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
        case ast.Compare(left=left, ops=ops, comparators=others) if all(
            type(op) in COMPARISONS for op in ops
        ):
            below = [left, *others]
        case ast.BoolOp(values=values):
            below = values
        case ast.Call(func=ast.Name(id="abs"), args=[argument], keywords=[]):
            below = [argument]
        case _:
            raise ValueError(f"'{ast.unparse(node)}' is not allowed; write {ALLOWED}")
    for one in below:
        if isinstance(one, ast.Constant) and isinstance(one.value, str) and not isinstance(node, ast.Compare):
            raise ValueError(  # noqa: TRY004 - as for any other text that is not allowed
                f"'{one.value}' is a text, which can only be compared; put a column's name between backticks"
            )
    return [node, *(deeper for one in below for deeper in _checked(one))]


def _name(node: ast.Name, quoted: Sequence[str]) -> str:
    found = re.fullmatch(r"_quoted_(\d+)_", node.id)
    return quoted[int(found[1])] if found and int(found[1]) < len(quoted) else node.id


def _value(node: ast.expr, columns: Mapping[str, Any], quoted: tuple[str, ...]) -> Any:
    import numpy as np

    def of(below: ast.expr) -> Any:
        return _value(below, columns, quoted)

    match node:
        case ast.Constant(value=value):
            found: Any = value if isinstance(value, str) else float(value)  # type: ignore[arg-type] # a number
        case ast.Name():
            found = columns[_name(node, quoted)]
        case ast.BinOp(left=left, op=op, right=right):
            found = ARITHMETIC[type(op)](of(left), of(right))
        case ast.UnaryOp(op=op, operand=operand):
            found = _unary(op, of(operand))
        case ast.Call(args=[argument]):
            found = np.abs(of(argument))
        case ast.BoolOp(op=op, values=values):
            truths = (_truth(of(one)) for one in values)
            found = reduce(np.logical_and if isinstance(op, ast.And) else np.logical_or, truths)
        case ast.Compare(left=left, ops=ops, comparators=others):
            sides = [of(one) for one in (left, *others)]
            pairs = zip(sides, ops, sides[1:], strict=False)
            found = reduce(np.logical_and, (_compared(type(op), a, b) for a, op, b in pairs))
        case _:
            raise AssertionError(node)
    return found


def _truth(value: Any) -> Any:
    """Return whether values are other than 0; an empty cell is nothing."""
    import numpy as np

    return value if np.asarray(value).dtype == bool else (value != 0) & ~np.isnan(value)


def _compared(op: type[ast.cmpop], one: Any, other: Any) -> Any:
    """Return a comparison of like with like; an empty cell is neither equal to a number nor another one."""
    import numpy as np

    texts = [np.asarray(side).dtype.kind in "OSU" for side in (one, other)]
    if texts[0] != texts[1]:
        raise TypeError
    found = COMPARISONS[op](one, other)
    if op is ast.NotEq and not texts[0]:
        found = found & ~(np.isnan(one) | np.isnan(other))
    return found


def _unary(op: ast.unaryop, value: Any) -> Any:
    if isinstance(op, ast.Not):
        return value == 0
    return -value if isinstance(op, ast.USub) else value
