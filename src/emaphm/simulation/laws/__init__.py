"""The laws of physics, one subject a file: pure functions of scalars or arrays, for Python and kernels."""
