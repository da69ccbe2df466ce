"""Imports between files of the package, for tests of its architecture and of dependencies of results."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import emaphm

ROOT = Path(emaphm.__file__).parent


def module_name(path: Path) -> str:
    """Return the module name of a file."""
    parts = path.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in ROOT.rglob("*.py")}


@cache
def tree_of(name: str) -> ast.Module:
    """Return the syntax tree of a module."""
    return ast.parse(MODULES[name].read_text(encoding="utf-8"))


def import_statements(
    tree: ast.AST, *, when_called: bool, for_types: bool = False
) -> Iterator[ast.Import | ast.ImportFrom]:
    """Yield the imports of `tree` at load time, with `when_called` also those within functions.

    Imports only for type checkers are no dependency of the running program: they are left out, except with
    `for_types`.
    """
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.expr):  # holds no import, but most of the nodes
            continue
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test) and not for_types:
            continue
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and not when_called:
            continue
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node
        else:
            yield from import_statements(node, when_called=when_called, for_types=for_types)


def imported_names(tree: ast.AST, *, when_called: bool, for_types: bool = False) -> Iterator[tuple[str, str]]:
    """Yield the names that `tree` imports from modules of the package: the module and the name, or ""."""
    for node in import_statements(tree, when_called=when_called, for_types=for_types):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names if alias.name in MODULES)
        elif node.module and node.module.startswith("emaphm"):
            yield from ((node.module, alias.name) for alias in node.names)


def imported(tree: ast.AST, *, when_called: bool, for_types: bool = False) -> Iterator[str]:
    """Yield the modules of the package that `tree` imports at load time, or also in functions.

    Imports only for type checkers are left out, except with `for_types`.
    """
    for module, name in imported_names(tree, when_called=when_called, for_types=for_types):
        below = f"{module}.{name}"
        yield below if below in MODULES else module


@cache
def handed_on(package: str) -> dict[str, str]:
    """Return the names that the `__init__` of a package re-exports, each with its module of definition."""
    if MODULES[package].name != "__init__.py":
        return {}
    return {name: module for module, name in imported_names(tree_of(package), when_called=False)}


def home_of(module: str, name: str) -> str:
    """Return the module that defines a name imported from `module`."""
    home = handed_on(module).get(name)
    if home is not None:
        return home_of(home, name)
    below = f"{module}.{name}"
    return below if below in MODULES else module


def reached(start: str) -> set[str]:
    """Return the modules on which `start` depends when loaded or called, including `start`.

    A re-exported name leads to the file that defines it, not to all files of the package.
    """
    modules: set[str] = set()
    waiting = [start]
    while waiting:
        module = waiting.pop()
        if module not in modules:
            modules.add(module)
            names = imported_names(tree_of(module), when_called=True)
            waiting += [home_of(*imported_name) for imported_name in names]
    return modules
