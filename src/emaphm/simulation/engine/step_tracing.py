"""A model's step as instructions of LLVM: it is called once, with scalars that note what is done to them.

A model says what one actuator does in one step: a function of tuples of scalars, made of arithmetic and of
NumPy's functions of numbers. NumPy hands what is done to a `Scalar` on to it (`__array_ufunc__`), and it
becomes an instruction. What a model decides in Python, by the actuator's laws say, is decided then and takes
no time in a kernel; what depends on a number is `laws.select`ed.
"""

from collections import namedtuple
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from numbers import Real
from typing import Any

import numpy as np
from llvmlite import ir
from numpy.lib.mixins import NDArrayOperatorsMixin

REAL = ir.DoubleType()

FAST = ("fast",)
"""LLVM may reorder, contract and assume that all is finite: a kernel's outputs are checked for that."""

StepInputs = namedtuple(  # noqa: PYI024 - its fields are scalars of any kind
    "StepInputs", ("command", "load", "noise", "enabled", "time", "step", "carried")
)
"""What drives all lanes in a step: command [rad], load [N·m], noise on the reference
current [A], whether the drive is switched on (1, else 0), time and step [s]; `carried` is 1 where motion is
recorded as the step has led to, 0 as at its start."""


class Scalar(NDArrayOperatorsMixin):
    """A number, or a condition, of a kernel: `value` of the instructions that `builder` appends."""

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value = builder, value

    def __array_ufunc__(self, ufunc: Any, method: str, *operands: Any, **options: Any) -> Any:
        """Append the instruction that NumPy's `ufunc` is."""
        if not _all_numbers(operands):
            return NotImplemented
        if method != "__call__" or options or ufunc not in INSTRUCTIONS:
            raise TypeError(f"a kernel has no {ufunc.__name__}; it has {', '.join(sorted(_names()))}")
        values = (_value(one) for one in operands)
        return Scalar(self.builder, INSTRUCTIONS[ufunc](self.builder, *values))

    def __array_function__(
        self, function: Any, _types: Any, operands: tuple[Any, ...], options: Mapping[str, Any]
    ) -> Any:
        """Append the instruction that `numpy.where` is."""
        if not _all_numbers(operands):
            return NotImplemented
        if function is not np.where or options or len(operands) != 3:
            raise TypeError(f"a kernel has no {function.__name__}; it has {', '.join(sorted(_names()))}")
        return Scalar(self.builder, self.builder.select(*(_value(one) for one in operands), flags=FAST))

    def __bool__(self) -> bool:
        """Refuse: what is built once cannot branch on a number of every step."""
        raise TypeError("a kernel cannot branch on a number; use select(condition, chosen, other)")

    def __float__(self) -> float:
        """Refuse: nothing is known of it yet."""
        raise TypeError("a kernel's numbers have no value before it runs; use NumPy's functions, not math's")


def _all_numbers(operands: Iterable[Any]) -> bool:
    """Return whether all are single numbers; `Phases` do themselves what is done to them."""
    return all(isinstance(one, (Scalar, Real)) for one in operands)


def _value(number: Any) -> Any:
    """Return LLVM's value of a `Scalar`, or of a number that is known."""
    if isinstance(number, Scalar):
        return number.value
    return ir.Constant(REAL, float(number))


def _names() -> list[str]:
    """Return the names of NumPy's functions that a kernel has."""
    return ["where", *(one.__name__ for one in INSTRUCTIONS)]


def _arithmetic(instruction: str) -> Callable[..., Any]:
    return lambda builder, *values: getattr(builder, instruction)(*values, flags=FAST)


def _comparison(operator: str) -> Callable[..., Any]:
    return lambda builder, one, other: builder.fcmp_ordered(operator, one, other, flags=FAST)


def _extreme(operator: str) -> Callable[..., Any]:
    """Return what keeps the one of two numbers that compares so to the other."""
    compared = _comparison(operator)
    return lambda builder, one, other: builder.select(compared(builder, one, other), one, other, flags=FAST)


def _function(name: str) -> Callable[..., Any]:
    """Return what calls a function of LLVM's own of real numbers."""

    def call(builder: Any, *values: Any) -> Any:
        kind = ir.FunctionType(REAL, [REAL] * len(values))
        function = builder.module.declare_intrinsic(f"llvm.{name}", [REAL], kind)
        return builder.call(function, values, fastmath=FAST)

    return call


INSTRUCTIONS: dict[Any, Callable[..., Any]] = {
    np.add: _arithmetic("fadd"),
    np.subtract: _arithmetic("fsub"),
    np.multiply: _arithmetic("fmul"),
    np.true_divide: _arithmetic("fdiv"),
    np.negative: _arithmetic("fneg"),
    np.less: _comparison("<"),
    np.less_equal: _comparison("<="),
    np.greater: _comparison(">"),
    np.greater_equal: _comparison(">="),
    np.equal: _comparison("=="),
    np.minimum: _extreme("<"),
    np.maximum: _extreme(">"),
    np.bitwise_and: lambda builder, one, other: builder.and_(one, other),
    np.absolute: _function("fabs"),
    np.copysign: _function("copysign"),
    np.sqrt: _function("sqrt"),
    np.cos: _function("cos"),
    np.sin: _function("sin"),
}
"""What each of NumPy's functions is in a kernel, of a builder and values."""


def traced(
    advance: Callable[..., Any],
    builder: Any,
    state: Mapping[str, Any],
    parameters: Mapping[str, Any],
    driving: StepInputs,
) -> tuple[list[Any], list[Any]]:
    """Append a model's step to a builder's instructions; return the next state and the channels.

    `advance` takes (state, parameters, inputs), named tuples of scalars, and returns the state after the
    step, a tuple in the order of its names, and the values of the model's channels. Here all are LLVM's
    values, or numbers that are known: `state` and `parameters` by name, `driving` those of the inputs.
    """

    def tuple_of(kind: Any, values: Iterable[Any]) -> Any:
        return kind(*(one if isinstance(one, float) else Scalar(builder, one) for one in values))

    following, outputs = advance(
        tuple_of(_named_tuple("State", tuple(state)), state.values()),
        tuple_of(_named_tuple("Parameters", tuple(parameters)), parameters.values()),
        tuple_of(StepInputs, driving),
    )
    return [_value(one) for one in following], [_value(one) for one in outputs]


@cache
def _named_tuple(name: str, fields: tuple[str, ...]) -> Any:
    return namedtuple(name, fields)  # noqa: PYI024
