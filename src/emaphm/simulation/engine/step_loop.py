"""The loop that every model's step stands in: over rows, steps and lanes, its state in one flat array.

A model says what one actuator does in one step: a function of tuples of scalars. LLVM turns the innermost
loop, over lanes, into vector instructions only where each row is read and written in that loop itself: a
function that is handed the arrays makes kernels ten times slower (measured). The lines that read and write
are therefore written out here, from the names of the rows.
"""

from collections import namedtuple
from collections.abc import Callable
from functools import cache
from typing import Any

LOOP = """
def kernel(
    x, p, command, load, load_stride, noise, noise_stride, enabled, enabled_stride,
    step, samples, substeps, window, carried, out, recorded,
):
    for sample in range(samples):
        for i in range({sums} * {lanes}, {rows} * {lanes}):
            x[i] = 0.0
        for substep in range(substeps):
            now = sample * substeps + substep
            inputs = StepInputs(
                command[now],
                load[now * load_stride],
                noise[now * noise_stride],
                enabled[now * enabled_stride],
                now * step,
                step,
                carried,
            )
            weight = 1.0 if substep < window else 0.0
            for lane in range({lanes}):
                state = State({state})
                parameters = Parameters({parameters})
                following, outputs = advance(state, parameters, inputs)
                {stores}
                {sums_of_outputs}
        for i in range(recorded):
            for lane in range({lanes}):
                out[lane, i, sample] = x[({sums} + i) * {lanes} + lane] / window
"""

StepInputs = namedtuple(  # noqa: PYI024 - its fields are scalars of any kind
    "StepInputs", ("command", "load", "noise", "enabled", "time", "step", "carried")
)
"""What drives all lanes in a step: command [rad], load [N·m], noise on the reference
current [A], whether the drive is switched on (1, else 0), time and step [s]; `carried` is 1 where motion is
recorded as the step has led to, 0 as at its start."""


def step_loop(
    advance: Callable[..., Any],
    state: tuple[str, ...],
    parameters: tuple[str, ...],
    lanes: int,
    channels: int,
) -> Any:
    """Return the kernel's Python function, as `compilation` compiles it.

    `advance` takes (state, parameters, inputs), named tuples of scalars, and returns the state after the
    step, a tuple in the order of `state`, and the values of the model's channels, of which the first
    `channels` can be recorded.
    """

    def read(array: str, count: int) -> str:
        return ", ".join(f"{array}[{i * lanes} + lane]" for i in range(count))

    def lines(texts: list[str]) -> str:
        return ("\n" + 16 * " ").join(texts)

    sums = len(state)
    source = LOOP.format(
        lanes=lanes,
        sums=sums,
        rows=sums + channels,
        state=read("x", sums),
        parameters=read("p", len(parameters)),
        stores=lines([f"x[{i * lanes} + lane] = following[{i}]" for i in range(sums)]),
        sums_of_outputs=lines(
            [f"x[{(sums + i) * lanes} + lane] += weight * outputs[{i}]" for i in range(channels)]
        ),
    )
    scope = {
        "State": _named_tuple("State", state),
        "Parameters": _named_tuple("Parameters", parameters),
        "StepInputs": StepInputs,
        "advance": advance,
    }
    exec(source, scope)  # noqa: S102 - the text above, with numbers filled in
    return scope["kernel"]


@cache
def _named_tuple(name: str, fields: tuple[str, ...]) -> Any:
    """Return the type of named tuples of `fields`: one for all layouts, which then share what takes it."""
    return namedtuple(name, fields)  # noqa: PYI024
