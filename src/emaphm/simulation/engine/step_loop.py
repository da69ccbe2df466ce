"""Kernel of a model's step: the loops over rows, steps and lanes in LLVM instructions.

LLVM vectorises the innermost loop, over lanes, only if all lanes are in one flat array, their number is
known, and there are no branches.
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
"""Names and types of a kernel's arguments, described in `compilation`."""

STACK_ALIGNMENT = CACHE_LINE
"""Alignment of a kernel's stack [bytes].

The registers do not suffice for a step, so vectors are spilled to the stack. Without alignment, most of them
span two cache lines. In six processes, a run of the reference model took 2.3 to 3.2 ms without alignment and
2.3 to 2.4 ms with it; a run of the averaged model 0.043 to 0.056 ms and 0.042 to 0.044 ms (AVX-512, four
channels).
"""


def kernel_of(form: Form, layout: Layout) -> str:
    """Return the text of the LLVM module of a kernel; its function is named `ENTRY`.

    The arrays of a kernel have a row for each name of the state or of the parameters, and a column for each
    lane. The rows of the state are followed by the rows of the sums of the channels of `layout`.
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
    """Return the address of an element of an array with rows of length `width`."""
    index = builder.add(builder.mul(row, width, flags=["nsw"]), column, flags=["nsw"])
    return builder.gep(array, [index], inbounds=True)


@contextmanager
def _loop(builder: Any, count: Any) -> Iterator[Any]:
    """Build a loop over the numbers from 0 to `count` - 1; the context builds its body."""
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
    """Return the inputs of all lanes at step `now`; `known` inputs are constants."""
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
    """Return the rows and weights of the four spline coefficients that are active at step `now`.

    The varying load has `count` coefficients, which are parameters of each lane; the list is empty if `count`
    is 0.
    """
    if not count:
        return []
    steps = builder.mul(arguments["samples"], arguments["substeps"], flags=["nsw"])
    per_step = builder.fdiv(REAL(float(count - MORE_THAN_INTERVALS)), builder.sitofp(steps, REAL))
    place = builder.fmul(builder.sitofp(now, REAL), per_step)
    interval = builder.fptosi(place, INTEGER)
    position_in_interval = builder.fsub(place, builder.sitofp(interval, REAL))
    first = builder.add(interval, INTEGER(parameters.index(coefficient_names(1)[0])), flags=["nsw"])
    weights = spline_weights(Scalar(builder, position_in_interval))
    return [(builder.add(first, INTEGER(i), flags=["nsw"]), weight.value) for i, weight in enumerate(weights)]


def _at_step(builder: Any, arguments: dict[str, Any], signal: str, now: Any) -> Any:
    """Return the value of a signal at step `now`, or its single value if its stride is 0."""
    stride = arguments.get(f"{signal}_stride", INTEGER(1))
    return builder.load(_place(builder, arguments[signal], now, stride, INTEGER(0)))
