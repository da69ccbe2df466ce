"""A kernel about a model's step: the loops over rows, steps and lanes, in instructions of LLVM's own.

Whether LLVM makes vector instructions of the innermost loop, over lanes, depends on what it is given: all
lanes in one flat array, their number known, no branches.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from llvmlite import ir

from emaphm.simulation.engine.model import CACHE_LINE, ENTRY, Form, Layout
from emaphm.simulation.engine.step_tracing import FAST, REAL, Scalar, StepInputs, traced
from emaphm.simulation.laws.load_variation import MORE_THAN_INTERVALS, coefficient_names, spline_weights

INTEGER = ir.IntType(64)
ARRAY = ir.PointerType(REAL)

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
    "out": ARRAY,
    "row": INTEGER,
}
"""Of a kernel, as `compilation` describes them."""

STACK_ALIGNMENT = CACHE_LINE
"""Of a kernel's own stack.

Registers do not suffice for a step. LLVM would leave vectors where the caller's stack happens to end, most of
them across two cache lines: in six processes a run of the reference model took 2.3 to 3.2 ms, aligned 2.3 to
2.4; one of the averaged model 0.043 to 0.056, and 0.042 to 0.044 (AVX-512, four channels).
"""


def kernel_of(form: Form, layout: Layout) -> str:
    """Return the LLVM module of a kernel, its function named `ENTRY`.

    The arrays of a kernel have a row for each name of state and parameters, and a column for each lane.
    The state's rows are followed by those of the sums of the channels that `layout` has.
    """
    structure, channels, known = layout.structure, layout.channels, dict(layout.known)
    state, parameters = form.state_names(structure), form.parameter_names(structure)
    advance = form.advance(structure)
    module = ir.Module()
    kernel = ir.Function(module, ir.FunctionType(ir.VoidType(), list(ARGUMENTS.values())), ENTRY)
    kernel.attributes.add("nounwind")  # llvmlite writes the alignment only next to another attribute
    kernel.attributes.alignstack = STACK_ALIGNMENT
    a = dict(zip(ARGUMENTS, kernel.args, strict=True))
    for argument in a.values():
        if argument.type == ARRAY:
            argument.add_attribute("noalias")
    builder = ir.IRBuilder(kernel.append_basic_block())
    width, zero, one, rows = INTEGER(layout.lanes), REAL(0.0), REAL(1.0), len(state)

    def at(array: str, row: Any, lane: Any) -> Any:
        return _place(builder, a[array], row, width, lane)

    with _loop(builder, a["samples"]) as sample:
        with _loop(builder, INTEGER(channels)) as i, _loop(builder, width) as lane:
            builder.store(zero, at("x", builder.add(i, INTEGER(rows)), lane))
        with _loop(builder, a["substeps"]) as substep:
            now = builder.add(builder.mul(sample, a["substeps"], flags=["nsw"]), substep, flags=["nsw"])
            weight = builder.select(builder.icmp_signed("<", substep, a["window"]), one, zero)
            driving = _driving(builder, a, known, now)
            spline = _spline(builder, a, parameters, structure.load_variation, now)
            with _loop(builder, width) as lane:
                before = {name: builder.load(at("x", INTEGER(i), lane)) for i, name in enumerate(state)}
                of_lane = {
                    name: known[name] if name in known else builder.load(at("p", INTEGER(i), lane))
                    for i, name in enumerate(parameters)
                }
                load = driving.load
                for row, share_of_it in spline:
                    part = builder.fmul(share_of_it, builder.load(at("p", row, lane)), flags=FAST)
                    load = builder.fadd(load, part, flags=FAST)
                following, outputs = traced(advance, builder, before, of_lane, driving._replace(load=load))
                for row, value in enumerate(following):
                    builder.store(value, at("x", INTEGER(row), lane))
                for i, value in enumerate(outputs[:channels]):
                    total = at("x", INTEGER(rows + i), lane)
                    added = builder.fmul(weight, value, flags=FAST)
                    builder.store(builder.fadd(builder.load(total), added, flags=FAST), total)
        share = builder.fdiv(one, builder.sitofp(a["window"], REAL))
        with _loop(builder, INTEGER(channels)) as i, _loop(builder, width) as lane:
            total = builder.load(at("x", builder.add(i, INTEGER(rows)), lane))
            row = builder.add(builder.mul(lane, INTEGER(channels)), i)
            mean = _place(builder, a["out"], row, a["row"], sample)
            builder.store(builder.fmul(total, share), mean)
    builder.ret_void()
    return str(module)


def _place(builder: Any, array: Any, row: Any, width: Any, column: Any) -> Any:
    """Return the address of an element of an array of rows of `width`."""
    index = builder.add(builder.mul(row, width, flags=["nsw"]), column, flags=["nsw"])
    return builder.gep(array, [index], inbounds=True)


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


def _driving(builder: Any, arguments: dict[str, Any], known: dict[str, float], now: Any) -> StepInputs:
    """Return what drives all lanes at step `now`; some of it is `known`."""
    step = arguments["step"]
    return StepInputs(
        command=_at_step(builder, arguments, "command", now),
        load=_at_step(builder, arguments, "load", now),
        noise=_at_step(builder, arguments, "noise", now),
        enabled=known.get("enabled") or _at_step(builder, arguments, "enabled", now),
        time=builder.fmul(builder.sitofp(now, REAL), step, flags=FAST),
        step=step,
        carried=known["carried"],
    )


def _spline(
    builder: Any, arguments: dict[str, Any], parameters: tuple[str, ...], count: int, now: Any
) -> list[tuple[Any, Any]]:
    """Return rows of the parameters, and their weights, that a lane's varying load has at step `now`.

    Four of the `count` coefficients of a spline over the run; none where there is no such load.
    """
    if not count:
        return []
    steps = builder.mul(arguments["samples"], arguments["substeps"], flags=["nsw"])
    per_step = builder.fdiv(REAL(float(count - MORE_THAN_INTERVALS)), builder.sitofp(steps, REAL))
    place = builder.fmul(builder.sitofp(now, REAL), per_step)
    interval = builder.fptosi(place, INTEGER)
    along = builder.fsub(place, builder.sitofp(interval, REAL))
    first = builder.add(interval, INTEGER(parameters.index(coefficient_names(1)[0])), flags=["nsw"])
    weights = spline_weights(Scalar(builder, along))
    return [(builder.add(first, INTEGER(i), flags=["nsw"]), one.value) for i, one in enumerate(weights)]


def _at_step(builder: Any, arguments: dict[str, Any], signal: str, now: Any) -> Any:
    """Return a signal's value at step `now`, or the only one that it has."""
    stride = arguments.get(f"{signal}_stride", INTEGER(1))
    return builder.load(_place(builder, arguments[signal], now, stride, INTEGER(0)))
