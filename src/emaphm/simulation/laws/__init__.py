"""The laws of physics, one a file: pure functions of scalars or arrays."""
