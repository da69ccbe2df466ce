"""Tracing of a model's step: one call, with scalars that record each operation as an instruction.

A model defines the step of one actuator as a function of tuples of scalars, made of arithmetic and NumPy
functions. NumPy passes each operation on a `Scalar` to `Scalar.__array_ufunc__`, which appends an LLVM
instruction. Decisions of the model in Python, for example which optional laws are used, are made during
tracing and take no time in a kernel; decisions that depend on a number use `laws.select`.
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
"""LLVM may reorder and contract operations and assume finite numbers; the outputs of a kernel are checked."""

StepInputs = namedtuple(  # noqa: PYI024 - its fields are scalars of any kind
    "StepInputs", ("command", "load", "noise", "enabled", "time", "step", "carried")
)
"""Inputs of all lanes in a step: command [rad], load [N·m], noise on the reference current [A], enabling of
the drive (1 or 0), time and step [s]; `carried` is 1 if the motion at the end of the step is recorded, 0 if
the motion at its start is recorded."""


class Scalar(NDArrayOperatorsMixin):
    """Number or condition in a kernel: `value` is LLVM's value, `builder` appends the instructions."""

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value = builder, value

    def __array_ufunc__(self, ufunc: Any, method: str, *operands: Any, **options: Any) -> Any:
        """Append the instruction of NumPy's `ufunc`."""
        if not _all_numbers(operands):
            return NotImplemented
        if method != "__call__" or options or ufunc not in INSTRUCTIONS:
            raise TypeError(f"a kernel has no {ufunc.__name__}; it has {', '.join(sorted(_names()))}")
        values = (_value(operand) for operand in operands)
        return Scalar(self.builder, INSTRUCTIONS[ufunc](self.builder, *values))

    def __array_function__(
        self, function: Any, _types: Any, operands: tuple[Any, ...], options: Mapping[str, Any]
    ) -> Any:
        """Append the instruction of `numpy.where`."""
        if not _all_numbers(operands):
            return NotImplemented
        if function is not np.where or options or len(operands) != 3:
            raise TypeError(f"a kernel has no {function.__name__}; it has {', '.join(sorted(_names()))}")
        values = (_value(operand) for operand in operands)
        return Scalar(self.builder, self.builder.select(*values, flags=FAST))

    def __bool__(self) -> bool:
        """Raise TypeError: a step that is traced once cannot branch on a number."""
        raise TypeError("a kernel cannot branch on a number; use select(condition, chosen, other)")

    def __float__(self) -> float:
        """Raise TypeError: the number has no value during tracing."""
        raise TypeError("a kernel's numbers have no value before it runs; use NumPy's functions, not math's")


def _all_numbers(operands: Iterable[Any]) -> bool:
    """Return whether all operands are single numbers; `Phases` handle their operations themselves."""
    return all(isinstance(operand, (Scalar, Real)) for operand in operands)


def _value(number: Any) -> Any:
    """Return LLVM's value of a `Scalar`, or LLVM's constant of a number."""
    if isinstance(number, Scalar):
        return number.value
    return ir.Constant(REAL, float(number))


def _names() -> list[str]:
    """Return the names of the NumPy functions that a kernel supports."""
    return ["where", *(function.__name__ for function in INSTRUCTIONS)]


def _arithmetic(instruction: str) -> Callable[..., Any]:
    return lambda builder, *values: getattr(builder, instruction)(*values, flags=FAST)


def _comparison(operator: str) -> Callable[..., Any]:
    return lambda builder, a, b: builder.fcmp_ordered(operator, a, b, flags=FAST)


def _extreme(operator: str) -> Callable[..., Any]:
    """Return the builder of the smaller ("<") or the larger (">") of two numbers."""
    compared = _comparison(operator)
    return lambda builder, a, b: builder.select(compared(builder, a, b), a, b, flags=FAST)


def _function(name: str) -> Callable[..., Any]:
    """Return the builder of a call to LLVM's intrinsic function `name` of real numbers."""

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
    np.bitwise_and: lambda builder, a, b: builder.and_(a, b),
    np.absolute: _function("fabs"),
    np.copysign: _function("copysign"),
    np.sqrt: _function("sqrt"),
    np.cos: _function("cos"),
    np.sin: _function("sin"),
}
"""Builder of the instruction for each NumPy function: a function of LLVM's builder and the operands."""


def traced(
    advance: Callable[..., Any],
    builder: Any,
    state: Mapping[str, Any],
    parameters: Mapping[str, Any],
    driving: StepInputs,
) -> tuple[list[Any], list[Any]]:
    """Append the instructions of a model's step to a builder; return the next state and the channels.

    `advance` is a function of (state, parameters, inputs), named tuples of scalars. It returns the state
    after the step, a tuple in the order of the names, and the values of the model's channels. `state` and
    `parameters` (by name) and the inputs `driving` are LLVM values, or known numbers.
    """

    def tuple_of(kind: Any, values: Iterable[Any]) -> Any:
        return kind(*(value if isinstance(value, float) else Scalar(builder, value) for value in values))

    following, outputs = advance(
        tuple_of(_named_tuple("State", tuple(state)), state.values()),
        tuple_of(_named_tuple("Parameters", tuple(parameters)), parameters.values()),
        tuple_of(StepInputs, driving),
    )
    return [_value(number) for number in following], [_value(number) for number in outputs]


@cache
def _named_tuple(name: str, fields: tuple[str, ...]) -> Any:
    return namedtuple(name, fields)  # noqa: PYI024
