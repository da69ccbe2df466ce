"""From a model's step in Python to machine code: LLVM vectorises its instructions and emits an object file.

A kernel advances `lanes` actuators together and records means over sample intervals. Its arguments:

x : float64 (rows × lanes,), the state row by row, then a row of sums for each channel; updated in place
p : float64 (rows × lanes,), the parameters row by row
command, load, noise, enabled : float64, a value a step for all lanes: `load[i × load_stride]` at step i
load_stride, noise_stride, enabled_stride : 1, or 0 where one value holds at every step
step : integration step [s]
samples : rows of the output
substeps : steps in a sample interval
window : steps at the start of each interval that its mean is taken over
out : float64 (lanes, channels, row), its first `samples` columns filled with the means

LLVM turns the innermost loop, over lanes, into vector instructions where the number of lanes is known
when compiling, all lanes are in one flat array, and the loop has neither branches nor calls left.
"""

import threading
from functools import cache
from typing import Any

import llvmlite.binding as llvm

from emaphm.simulation.engine.model import Layout, Model
from emaphm.simulation.engine.step_loop import kernel_of

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


COMPILING = threading.Lock()
"""Held by the one thread that compiles."""


def compiled(model: Model, layout: Layout) -> bytes:
    """Return the kernel of `model` as an object file for this machine, as `kernel_of` makes it.

    It has the C arguments of `step_loop.ARGUMENTS`: pointers are to float64, integers have 64 bits.
    """
    with COMPILING:
        _let_llvm_interleave()
        kernel = kernel_of(model.form(layout.structure), layout)
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        target = _this_machine()
        return bytes(target.emit_object(_optimized(kernel, target)))


@cache
def _let_llvm_interleave() -> None:
    """Have LLVM interleave as many vectors as `INTERLEAVED`, once: it ends a process that asks twice."""
    llvm.set_option("", f"-force-vector-interleave={INTERLEAVED}")


def _optimized(kernel: str, target: Any) -> Any:
    """Return the module `kernel` as LLVM leaves it."""
    module = llvm.parse_assembly(kernel)
    tuning = llvm.create_pipeline_tuning_options(speed_level=3)
    tuning.loop_vectorization = True
    # The loops over steps and lanes are long as they are: unrolled they took as long, within 5 %, with the
    # same bits, and 1.2 to 1.7 times the time to compile (measured where registers have 512 bits).
    tuning.loop_unrolling = False
    builder = llvm.create_pass_builder(target, tuning)
    builder.getModulePassManager().run(module, builder)
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
