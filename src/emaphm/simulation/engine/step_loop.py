"""The loops of a kernel about a model's step, over rows, steps and lanes: instructions of LLVM's own.

Loops in Python would have been through Numba's translation to machine code before LLVM can make vector
instructions of the innermost one, over lanes, and whether that is still possible would be chance. Numba also
takes ten times as long for them; a step it translates once, for all layouts.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from llvmlite import ir

from emaphm.simulation.engine.lane_step import ARRAYS, INTEGERS, REALS, place

REAL, INTEGER = ir.DoubleType(), ir.IntType(64)
ARRAY = ir.PointerType(REAL)
NOTHING = ir.IntType(8).as_pointer()
"""What Numba returns for None."""

ARGUMENTS = {
    "x": ARRAY,
    "p": ARRAY,
    "command": ARRAY,
    "load": ARRAY,
    "load_stride": INTEGER,
    "noise": ARRAY,
    "noise_stride": INTEGER,
    "enabled": ARRAY,
    "enabled_stride": INTEGER,
    "step": REAL,
    "samples": INTEGER,
    "substeps": INTEGER,
    "window": INTEGER,
    "carried": REAL,
    "out": ARRAY,
    "recorded": INTEGER,
    "row": INTEGER,
}
"""Of a kernel, as `compilation` describes them."""


def loop_about(step_name: str, name: str, rows: int, lanes: int, channels: int) -> str:
    """Return the LLVM module of the kernel `name`, which calls the function `step_name` of `lane_step`.

    The state has `rows` rows, followed by those of the sums of `channels` channels.
    """
    module = ir.Module()
    of_step = ir.FunctionType(NOTHING, [ARRAY] * ARRAYS + [INTEGER] * INTEGERS + [REAL] * REALS)
    advance = ir.Function(module, of_step, step_name)
    kernel = ir.Function(module, ir.FunctionType(ir.VoidType(), list(ARGUMENTS.values())), name)
    a = dict(zip(ARGUMENTS, kernel.args, strict=True))
    for argument in a.values():
        if argument.type == ARRAY:
            argument.add_attribute("noalias")
    builder = ir.IRBuilder(kernel.append_basic_block())
    width, zero, one = INTEGER(lanes), REAL(0.0), REAL(1.0)
    with _loop(builder, a["samples"]) as sample:
        with _loop(builder, INTEGER(channels)) as i, _loop(builder, width) as lane:
            builder.store(zero, place(builder, a["x"], builder.add(i, INTEGER(rows)), width, lane))
        with _loop(builder, a["substeps"]) as substep:
            now = builder.add(builder.mul(sample, a["substeps"], flags=["nsw"]), substep, flags=["nsw"])
            within = builder.icmp_signed("<", substep, a["window"])
            driving = [
                *(_at_step(builder, a, signal, now) for signal in ("command", "load", "noise", "enabled")),
                builder.fmul(builder.sitofp(now, REAL), a["step"], flags=["fast"]),
                a["step"],
                a["carried"],
                builder.select(within, one, zero),
            ]
            with _loop(builder, width) as lane:
                builder.call(advance, [a["x"], a["p"], lane, width, INTEGER(channels), *driving])
        share = builder.fdiv(one, builder.sitofp(a["window"], REAL))
        with _loop(builder, a["recorded"]) as i, _loop(builder, width) as lane:
            total = builder.load(place(builder, a["x"], builder.add(i, INTEGER(rows)), width, lane))
            row = builder.add(builder.mul(lane, a["recorded"]), i)
            mean = place(builder, a["out"], row, a["row"], sample)
            builder.store(builder.fmul(total, share), mean)
    builder.ret_void()
    return str(module)


@contextmanager
def _loop(builder: Any, count: Any) -> Iterator[Any]:
    """Give the numbers from 0 on, below `count`, to the instructions that are built inside."""
    before = builder.block
    head, body, after = (builder.append_basic_block() for _ in range(3))
    builder.branch(head)
    builder.position_at_end(head)
    number = builder.phi(INTEGER)
    number.add_incoming(INTEGER(0), before)
    builder.cbranch(builder.icmp_signed("<", number, count), body, after)
    builder.position_at_end(body)
    yield number
    number.add_incoming(builder.add(number, INTEGER(1), flags=["nsw"]), builder.block)
    builder.branch(head)
    builder.position_at_end(after)


def _at_step(builder: Any, arguments: dict[str, Any], signal: str, now: Any) -> Any:
    """Return a signal's value at step `now`, or the only one that it has."""
    stride = arguments.get(f"{signal}_stride", INTEGER(1))
    return builder.load(place(builder, arguments[signal], now, stride, INTEGER(0)))
