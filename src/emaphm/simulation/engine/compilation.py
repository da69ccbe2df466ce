"""From a model's step in Python to machine code: Numba translates, LLVM vectorises and emits an object file.

A kernel advances `lanes` actuators together and records means over sample intervals. Its arguments:

x : float64 (rows × lanes,), the state row by row, then a row of sums for each channel; updated in place
p : float64 (rows × lanes,), the parameters row by row
command, load, noise, enabled : float64, a value a step for all lanes: `load[i × load_stride]` at step i
load_stride, noise_stride, enabled_stride : 1, or 0 where one value holds at every step
step : integration step [s]
samples : rows of the output
substeps : steps in a sample interval
window : steps at the start of each interval that its mean is taken over
carried : 0 or 1, whether motion is recorded as at the start of a step or as it has led to
out : float64 (lanes, recorded, row), its first `samples` columns filled with the means
recorded : channels that are recorded, from the first on; at most those that the kernel is compiled for

LLVM turns the innermost loop, over lanes, into vector instructions where the number of lanes is known
when compiling, all lanes are in one flat array, and the loop has neither branches nor calls left.
"""

import gc
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import llvmlite.binding as llvm

from emaphm.simulation.engine.lane_step import ARRAYS, INTEGERS, REALS, lane_step
from emaphm.simulation.engine.model import ENTRY, Form, Layout, Model
from emaphm.simulation.engine.step_loop import loop_about
from emaphm.simulation.engine.structure import Structure
from emaphm.simulation.laws.inline import LAWS, select

REGISTERED: set[Any] = set()
"""Functions that Numba has been given to inline."""

NUMBA_OPTIONS: Any = {"fastmath": True, "error_model": "numpy"}

INLINED: Any = {"forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Of functions that only kernels call: nothing is compiled by which Python or C could call them."""

WIDEST = "avx512f", ",-prefer-256-bit"
"""A feature of processors, and what makes LLVM use their widest registers all the same.

For Intel's, LLVM keeps to half of the width, as programs that need it seldom would be slowed down by a lower
clock. A kernel computes nothing else for milliseconds: a run of the reference model takes 2.9 ms in place of
4.8, one of the averaged model 0.044 ms in place of 0.062 (measured on one such processor, of 2023; older ones
lower their clock more).
"""

INTERLEAVED = 2
"""Vectors of lanes that advance next to each other in an iteration of the innermost loop.

A step is a long chain of instructions that wait for each other. LLVM takes one vector at a time, as the
registers do not suffice for two; but what two spill costs less than the waiting. In 14 processes, a run of
the reference model took 0.62 to 1.06 of the time that it takes with one, 0.89 in the mean; where one channel
is recorded, about 0.8 (AMD's Zen 3, AVX2).
"""


@contextmanager
def _no_collection() -> Iterator[None]:
    """Leave garbage where it is meanwhile.

    Numba makes millions of objects that stay, and Python would look through them again and again for cycles
    to break: a fifth of a kernel's compilation (measured).
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


COMPILING = threading.Lock()
"""Held by the one thread that compiles."""


@_no_collection()
def compiled(model: Model, layout: Layout) -> bytes:
    """Return the kernel of `model` as an object file for this machine, its function named `ENTRY`.

    It has the C arguments of `step_loop.ARGUMENTS`: pointers are to float64, integers have 64 bits.
    """
    lanes, channels, structure = layout
    form = model.form(structure)
    with COMPILING:
        _let_llvm_interleave()
        step, name = _translated(form, structure)
        loop = loop_about(name, ENTRY, len(form.state_names(structure)), lanes, channels)
        llvm.initialize_native_asmprinter()
        target = _this_machine()
        return bytes(target.emit_object(_optimized(step, loop, target)))


@cache
def _translated(form: Form, structure: Structure) -> tuple[str, str]:
    """Return the LLVM module of a model's step of one lane, and the name of its function there."""
    # Numba takes 0.25 s to get ready, more than a whole diagnosis; a kernel that is cached does without.
    import numba
    from numba import types
    from numba.extending import overload, register_jitable

    if not REGISTERED:
        overload(select)(_select_scalar)
        REGISTERED.add(select)
    advance = form.advance(structure)
    for law in (*LAWS, advance):
        if law not in REGISTERED:
            register_jitable(**INLINED)(law)
            REGISTERED.add(law)
    array: Any = types.CPointer(types.float64)  # type: ignore[no-untyped-call]
    arguments = (array,) * ARRAYS + (types.int64,) * INTEGERS + (types.float64,) * REALS
    step = lane_step(advance, form.state_names(structure), form.parameter_names(structure))
    found = numba.cfunc(types.void(*arguments), **NUMBA_OPTIONS)(step)
    # Numba would not have a function inlined where C calls it.
    return found.inspect_llvm().replace("noinline", "alwaysinline"), found.native_name


@cache
def _let_llvm_interleave() -> None:
    """Have LLVM interleave as many vectors as `INTERLEAVED`, once: it ends a process that asks twice."""
    llvm.set_option("", f"-force-vector-interleave={INTERLEAVED}")


def _select_scalar(condition: Any, chosen: Any, other: Any) -> Any:  # noqa: ARG001
    def implementation(condition: Any, chosen: Any, other: Any) -> Any:
        return chosen if condition else other

    return implementation


def _optimized(step: str, loop: str, target: Any) -> Any:
    """Return the function `ENTRY` of the module `loop` with its step, of another module, as LLVM leaves it.

    No step raises an error. Once LLVM has seen that, nothing is left of Numba's way to raise one, and
    with it no reference to Numba or Python: the object file can be used without either.
    """
    module = llvm.parse_assembly(step)
    module.link_in(llvm.parse_assembly(loop))
    for value in (*module.functions, *module.global_variables):
        if not value.is_declaration and value.name != ENTRY:
            value.linkage = "internal"
    for function in module.functions:
        if not function.is_declaration and function.name != ENTRY:
            function.add_function_attribute("alwaysinline")
    tuning = llvm.create_pipeline_tuning_options(speed_level=3)
    tuning.loop_vectorization = True
    builder = llvm.create_pass_builder(target, tuning)
    builder.getModulePassManager().run(module, builder)
    missing = [f.name for f in module.functions if f.is_declaration and not f.name.startswith("llvm.")]
    if missing:
        raise RuntimeError(f"a kernel cannot use {', '.join(missing)}: it runs without Numba and Python")
    return module


def _this_machine() -> Any:
    """Return LLVM's description of this processor, all of its registers' width in use."""
    features = llvm.get_host_cpu_features()
    has, use_all = WIDEST
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=features.flatten() + (use_all if features.get(has) else ""),
        opt=3,
        reloc="pic",
        codemodel="small",
        jit=True,
    )
