"""Laws of physics, one subject per file: pure functions of scalars or arrays, for Python and for kernels."""
