"""Which files of the package import which: for tests of its rooms, and of what results depend on."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import emaphm

ROOT = Path(emaphm.__file__).parent


def module_name(path: Path) -> str:
    """Return the name by which a file is imported."""
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
    """Yield the imports of `tree` as it is loaded, or also when it is called.

    Imports for type checkers alone are no dependency of the running program: they are left out but
    `for_types`.
    """
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.expr):  # holds no import, and most of the nodes
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
    """Yield the modules of the package that `tree` imports as it is loaded, or also when it is called.

    Those for type checkers alone are left out but `for_types`.
    """
    for module, name in imported_names(tree, when_called=when_called, for_types=for_types):
        below = f"{module}.{name}"
        yield below if below in MODULES else module


@cache
def handed_on(package: str) -> dict[str, str]:
    """Return the names that the `__init__` of a package hands on, with the module that each comes from."""
    if MODULES[package].name != "__init__.py":
        return {}
    return {name: module for module, name in imported_names(tree_of(package), when_called=False)}


def home_of(module: str, name: str) -> str:
    """Return the module that a name comes from which is imported from `module`."""
    home = handed_on(module).get(name)
    if home is not None:
        return home_of(home, name)
    below = f"{module}.{name}"
    return below if below in MODULES else module


def reached(start: str) -> set[str]:
    """Return the modules that `start` depends on, loaded or called, with itself.

    A name that a package hands on leads to the file that it comes from, not to all that the package has.
    """
    found: set[str] = set()
    waiting = [start]
    while waiting:
        module = waiting.pop()
        if module not in found:
            found.add(module)
            names = imported_names(tree_of(module), when_called=True)
            waiting += [home_of(*one) for one in names]
    return found
