"""Cache of compiled kernels on disk: loads a kernel, or compiles and stores it."""

import ctypes
import hashlib
import marshal
import os
import re
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, cast

from emaphm.simulation.engine.model import ENTRY, Layout, Model

Kernel = Callable[..., None]
"""Function with the C arguments of `compilation.compiled`, pointers as integers; it releases the GIL."""

ENDING = ".kernel"
"""Extension of the file of a stored kernel."""

DIGEST = 32
"""Length of a digest [bytes]."""

ARRAY, INTEGER, REAL = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
FUNCTION = ctypes.CFUNCTYPE(
    None,
    *(ARRAY, ARRAY, ARRAY, ARRAY, INTEGER, ARRAY, INTEGER, ARRAY, INTEGER, REAL),
    *(INTEGER, INTEGER, INTEGER, ARRAY, INTEGER),
)


@cache
def kernel(model: Model, layout: Layout) -> Kernel:
    """Return the kernel of `model` that is compiled for `layout`."""
    revision = _revision(model, layout)
    path = kernel_folder() / f"{_file_name(model, layout)}.{_machine()[:12]}{ENDING}"
    code = _read(path, revision)
    if code is None:
        from emaphm.simulation.engine.compilation import compiled

        code = compiled(model, layout)
        _write(path, revision, code)
    return _loaded(code)


def _loaded(code: bytes) -> Kernel:
    """Return the function `ENTRY` of an object file."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    linker = llvm.create_lljit_compiler(use_jit_link=True)
    library = llvm.JITLibraryBuilder().add_object_img(code).add_current_process().export_symbol(ENTRY)
    tracker = library.link(linker, ENTRY)
    function: Any = FUNCTION(tracker[ENTRY])
    function.code = tracker, linker  # the machine code is freed with these objects
    return cast("Kernel", function)


def _file_name(model: Model, layout: Layout) -> str:
    name = re.sub(r"\W+", "-", model.name).strip("-")
    of_structure = hashlib.sha256(repr((layout.structure, layout.known)).encode()).hexdigest()[:8]
    return f"{name}-{layout.structure.drive}-{of_structure}-{layout.lanes}-{layout.channels}"


@cache
def _machine() -> str:
    """Return a digest of the processor for which code is compiled."""
    import llvmlite.binding as llvm

    processor = f"{sys.platform} {llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"
    return hashlib.sha256(processor.encode()).hexdigest()


def _digest_of_sources() -> bytes:
    """Return a digest of what defines all kernels: the source of the simulation and llvmlite's version."""
    import llvmlite

    digest = hashlib.sha256(llvmlite.__version__.encode())
    for source in sorted(Path(__file__).parents[1].glob("*/*.py")):
        digest.update(source.read_bytes())
    return digest.digest()


SOURCES = _digest_of_sources()
"""Digest at import: kernels of a running process are not stored for source that is edited meanwhile."""


def _revision(model: Model, layout: Layout) -> bytes:
    """Return a digest of all that defines the kernel of `model`, which may be outside of the package."""
    build: Any = model.form(layout.structure).advance
    cells = [cell.cell_contents for cell in build.__closure__ or ()]
    options = [value for value in cells if isinstance(value, str | bool)]
    digest = hashlib.sha256(SOURCES + repr((build.__qualname__, options, layout)).encode())
    source = Path(build.__code__.co_filename)
    digest.update(source.read_bytes() if source.is_file() else marshal.dumps(build.__code__))
    return digest.digest()


@cache
def kernel_folder() -> Path:
    """Return the folder of stored kernels.

    `EMAPHM_CACHE_DIR` if set; otherwise `__pycache__` of this package if it is writable, or the user's cache.
    """
    if "EMAPHM_CACHE_DIR" in os.environ:
        return Path(os.environ["EMAPHM_CACHE_DIR"])
    local = Path(__file__).parent / "__pycache__"
    if os.access(local if local.exists() else local.parent, os.W_OK):
        return local
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "emaphm"


def _read(path: Path, revision: bytes) -> bytes | None:
    """Return the code stored at `path`, or None if it is absent, damaged or of another `revision`."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    stored_revision, checksum, code = content[:DIGEST], content[DIGEST : 2 * DIGEST], content[2 * DIGEST :]
    return code if stored_revision == revision and checksum == hashlib.sha256(code).digest() else None


def _write(path: Path, revision: bytes, code: bytes) -> None:
    """Store `code` at `path` atomically; if it cannot be stored, the next process compiles it again."""
    part = path.with_name(f"{path.name}.{os.getpid()}-{threading.get_ident()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(revision + hashlib.sha256(code).digest() + code)
        part.replace(path)
    except OSError:
        with suppress(OSError):
            part.unlink(missing_ok=True)
