"""Compilation of a model's step to machine code: LLVM vectorises the instructions and emits an object file.

A kernel advances `lanes` actuators together and records means over sample intervals. Its arguments:

x : float64 (rows × lanes,), the state row by row, then a row of sums for each channel; updated in place
p : float64 (rows × lanes,), the parameters row by row
command, load, noise, enabled : float64, one value per step for all lanes: `load[i × load_stride]` at step i
load_stride, noise_stride, enabled_stride : 1, or 0 for a signal with one value for all steps
step : integration step [s]
samples : rows of the output
substeps : steps in a sample interval
window : number of steps, from the start of each interval, over which the mean is computed
out : float64 (lanes, channels, row); the kernel writes the means to the first `samples` columns

LLVM vectorises the innermost loop, over lanes, if the number of lanes is known at compile time, all lanes
are in one flat array, and the loop contains neither branches nor calls.
"""

import threading
from functools import cache
from typing import Any

import llvmlite.binding as llvm

from emaphm.simulation.engine.model import Layout, Model
from emaphm.simulation.engine.step_loop import kernel_of

WIDEST = "avx512f", ",-prefer-256-bit"
"""Processor feature with the widest registers, and the LLVM option that makes LLVM use their full width.

By default, LLVM uses half of the width on Intel processors, because the processor lowers its clock for the
full width, which slows down programs that seldom need it. A kernel uses these registers for milliseconds: a
run of the reference model takes 2.9 ms instead of 4.8 ms, a run of the averaged model 0.044 ms instead of
0.062 ms (measured on one such processor of 2023; older processors lower their clock more).
"""

INTERLEAVED = 2
"""Vectors of lanes that are interleaved in an iteration of the innermost loop.

A step is a long chain of dependent instructions. By default LLVM uses one vector, because the registers do
not suffice for two; but spilling two vectors costs less time than the latency of one. In 14 processes, a run
of the reference model took 0.62 to 1.06 of the time with one vector, 0.89 on average; with one recorded
channel about 0.8 (AMD's Zen 3, AVX2).
"""


COMPILING = threading.Lock()
"""Lock of the compiler: one thread compiles at a time."""


def compiled(model: Model, layout: Layout) -> bytes:
    """Return the kernel of `model`, built by `kernel_of`, as an object file for this machine.

    Its function has the C arguments `step_loop.ARGUMENTS`: pointers to float64, integers of 64 bits.
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
    """Set LLVM's option to interleave `INTERLEAVED` vectors; once, because LLVM aborts if it is set twice."""
    llvm.set_option("", f"-force-vector-interleave={INTERLEAVED}")


def _optimized(kernel: str, target: Any) -> Any:
    """Return the LLVM module of the text `kernel`, optimised."""
    module = llvm.parse_assembly(kernel)
    tuning = llvm.create_pipeline_tuning_options(speed_level=3)
    tuning.loop_vectorization = True
    # The bodies of the loops over steps and lanes are already long. Unrolled loops had the same run time
    # within 5 %, the same bits, and 1.2 to 1.7 times the compile time (measured with registers of 512 bits).
    tuning.loop_unrolling = False
    builder = llvm.create_pass_builder(target, tuning)
    builder.getModulePassManager().run(module, builder)
    return module


def _this_machine() -> Any:
    """Return LLVM's target machine for this processor, with the full width of its registers."""
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
