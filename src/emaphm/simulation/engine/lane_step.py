"""A model's step of one lane, for Numba to compile: what is about it reads and writes that lane's values.

A model says what one actuator does in one step: a function of tuples of scalars. The arrays of a kernel have
a row for each of their fields, and a column for each lane. An index into an array for each of a hundred rows
would take Numba longer to translate than the model itself: instructions of our own (Numba's intrinsics) read
and write a tuple at once.
"""

from collections import namedtuple
from collections.abc import Callable
from functools import cache
from typing import Any

StepInputs = namedtuple(  # noqa: PYI024 - its fields are scalars of any kind
    "StepInputs", ("command", "load", "noise", "enabled", "time", "step", "carried")
)
"""What drives all lanes in a step: command [rad], load [N·m], noise on the reference
current [A], whether the drive is switched on (1, else 0), time and step [s]; `carried` is 1 where motion is
recorded as the step has led to, 0 as at its start."""

ARRAYS, INTEGERS, REALS = 2, 3, 8
"""How many arguments of each kind `lane_step` makes a function of, in this order."""


def lane_step(advance: Callable[..., Any], state: tuple[str, ...], parameters: tuple[str, ...]) -> Any:
    """Return the Python function that advances one lane by one step, for Numba to compile.

    `advance` takes (state, parameters, inputs), named tuples of scalars, and returns the state after the
    step, a tuple in the order of `state`, and the values of the model's channels. The function takes the
    arrays `x` and `p` of a kernel, the lane, the number of lanes and of channels that are summed up, the
    fields of `StepInputs`, and what the channels are multiplied by before they are added to their sums.
    """
    state_of, parameters_of = _reader("State", state), _reader("Parameters", parameters)
    write, add = _writer(len(state)), _adder(len(state))

    def step_of_lane(
        x: Any,
        p: Any,
        lane: Any,
        lanes: Any,
        channels: Any,
        command: Any,
        load: Any,
        noise: Any,
        enabled: Any,
        time: Any,
        step: Any,
        carried: Any,
        weight: Any,
    ) -> None:
        inputs = StepInputs(command, load, noise, enabled, time, step, carried)
        following, outputs = advance(state_of(x, lane, lanes), parameters_of(p, lane, lanes), inputs)
        write(x, lane, lanes, following)
        add(x, lane, lanes, outputs, channels, weight)

    return step_of_lane


def place(builder: Any, array: Any, row: Any, width: Any, column: Any) -> Any:
    """Return the address of an element of an array of rows of `width`."""
    index = builder.add(builder.mul(row, width, flags=["nsw"]), column, flags=["nsw"])
    return builder.gep(array, [index], inbounds=True)


def _reader(name: str, fields: tuple[str, ...]) -> Any:
    """Return what reads a lane's values from the first rows of an array, as a named tuple of `fields`."""
    from numba import types
    from numba.extending import intrinsic

    named: Any = types.NamedUniTuple
    of = named(types.float64, len(fields), _named_tuple(name, fields))

    @intrinsic
    def read(_: Any, array: Any, lane: Any, lanes: Any) -> Any:
        def code(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
            places = _places(builder, arguments, range(len(fields)))
            return context.make_tuple(builder, of, [builder.load(at) for at in places])

        return of(array, lane, lanes), code

    return read


def _writer(count: int) -> Any:
    """Return what writes a tuple of `count` values to the first rows of an array, at a lane."""
    from numba import types
    from numba.extending import intrinsic

    @intrinsic
    def write(_: Any, array: Any, lane: Any, lanes: Any, values: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            numbers = _numbers(context, builder, signature.args[3], arguments[3])
            for at, value in zip(_places(builder, arguments, range(count)), numbers, strict=True):
                builder.store(value, at)
            return context.get_dummy_value()

        return types.none(array, lane, lanes, values), code

    return write


def _adder(first: int) -> Any:
    """Return what adds the first `count` of a tuple's values, times a weight, to rows from `first` on."""
    from numba import types
    from numba.extending import intrinsic

    @intrinsic
    def add(_: Any, array: Any, lane: Any, lanes: Any, values: Any, count: Any, weight: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            numbers = _numbers(context, builder, signature.args[3], arguments[3])
            places = _places(builder, arguments, range(first, first + len(numbers)))
            for i, (at, value) in enumerate(zip(places, numbers, strict=True)):
                # A number that is known in a kernel: nothing is left of the channels that are not asked for.
                with builder.if_then(builder.icmp_signed("<", arguments[4].type(i), arguments[4])):
                    product = builder.fmul(arguments[5], value)
                    builder.store(builder.fadd(builder.load(at), product), at)
            return context.get_dummy_value()

        return types.none(array, lane, lanes, values, count, weight), code

    return add


def _places(builder: Any, arguments: Any, rows: range) -> list[Any]:
    """Return the addresses of `rows` at a lane; array, lane and number of lanes are the first arguments."""
    array, lane, lanes = arguments[:3]
    return [place(builder, array, lane.type(row), lanes, lane) for row in rows]


def _numbers(context: Any, builder: Any, kinds: Any, values: Any) -> list[Any]:
    """Return the values of a tuple as real numbers."""
    from numba import types

    each = (builder.extract_value(values, i) for i in range(len(kinds)))
    return [context.cast(builder, one, kind, types.float64) for one, kind in zip(each, kinds, strict=True)]


@cache
def _named_tuple(name: str, fields: tuple[str, ...]) -> Any:
    """Return the type of named tuples of `fields`: one for all structures that have them."""
    return namedtuple(name, fields)  # noqa: PYI024
