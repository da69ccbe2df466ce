"""From a kernel in Python to machine code: Numba translates and vectorises, LLVM emits an object file.

A kernel advances `lanes` actuators together and records means over sample intervals. Its arguments:

x : float64 (rows × lanes,), the state row by row, then a row of sums for each recorded channel; updated in place
p : float64 (rows × lanes,), the parameters row by row
command, load, noise : float64, one value a step, shared by all lanes: `load[i × load_stride]` at step i
load_stride, noise_stride : 1, or 0 where one value holds at every step
step : integration step [s]
substeps : steps in a sample interval
window : steps at the start of each interval that its mean is taken over
carried : 0 or 1, whether motion is recorded as at the start of a step or as it has led to
out : float64 (channels, samples, lanes), filled with the means

LLVM turns the innermost loop, over lanes, into vector instructions where the number of lanes is known
when compiling, all lanes stand in one flat array, and the loop has neither branches nor calls left. Laws
take scalars for that reason: a function that is handed `x` or `p` itself makes the kernels ten times slower
(measured), which is why the kernels repeat how their common rows are read and written.
"""

from typing import Any

import llvmlite.binding as llvm

from emaphm.simulation.engine.model import Layout, Model
from emaphm.simulation.laws.inline import LAWS, select

ENTRY = "advance"
"""Name of the function that a kernel's object file defines."""

REGISTERED = {select}
"""What Numba has been told how to inline."""

NUMBA_OPTIONS: Any = {"fastmath": True, "error_model": "numpy"}


def compiled(model: Model, layout: Layout) -> bytes:
    """Return the kernel of `model` as an object file for this machine, its function named `ENTRY`.

    It has the C arguments (pointers are to float64; integers of 64 bits): x, p, command, load, load_stride,
    noise, noise_stride, step, samples, substeps, window, carried, out.
    """
    # Numba takes 0.25 s to get ready, more than a whole diagnosis; a kernel that is cached does without.
    import numba
    from numba.extending import overload, register_jitable

    for law in LAWS:
        if law not in REGISTERED:
            register_jitable(law)
            REGISTERED.add(law)
    overload(select)(_select_scalar)
    lanes, channels = layout
    kernel = numba.njit(**NUMBA_OPTIONS)(model.build(layout))
    carray = numba.carray

    def advance(
        x: Any,
        p: Any,
        command: Any,
        load: Any,
        load_stride: Any,
        noise: Any,
        noise_stride: Any,
        step: Any,
        samples: Any,
        substeps: Any,
        window: Any,
        carried: Any,
        out: Any,
    ) -> None:
        # The lengths of flat arrays do not matter: a kernel checks no index.
        kernel(
            carray(x, 1),
            carray(p, 1),
            carray(command, 1),
            carray(load, 1),
            load_stride,
            carray(noise, 1),
            noise_stride,
            step,
            substeps,
            window,
            carried,
            carray(out, (channels, samples, lanes)),
        )

    array = numba.types.CPointer(numba.float64)
    integer, real = numba.int64, numba.float64
    signature = numba.void(
        array, array, array, array, integer, array, integer, real, integer, integer, integer, real, array
    )
    translated = numba.cfunc(signature, **NUMBA_OPTIONS)(advance)
    return _object_file(translated.inspect_llvm(), translated.native_name)


def _select_scalar(condition: Any, chosen: Any, other: Any) -> Any:  # noqa: ARG001
    def implementation(condition: Any, chosen: Any, other: Any) -> Any:
        return chosen if condition else other

    return implementation


def _object_file(text: str, name: str) -> bytes:
    """Return the object file of the LLVM module in `text`, less everything that function `name` does not use.

    No kernel raises an error. Once LLVM has seen that, nothing is left of Numba's way to raise one, and
    with it no reference to Numba or Python: the object file can be used without either.
    """
    module = llvm.parse_assembly(text)
    entry = module.get_function(name)
    for value in (*module.functions, *module.global_variables):
        if not value.is_declaration and value.name != name:
            value.linkage = "internal"
    entry.name = ENTRY
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=3,
        reloc="pic",
        codemodel="small",
        jit=True,
    )
    passes = llvm.create_new_module_pass_manager()
    passes.add_ipsccp_pass()
    passes.add_global_opt_pass()
    passes.add_simplify_cfg_pass()
    passes.add_dead_arg_elimination_pass()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(module, llvm.create_pass_builder(target, llvm.create_pipeline_tuning_options(speed_level=3)))
    return target.emit_object(module)
