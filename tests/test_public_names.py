"""Public names of the package: its three lists agree, before any of its modules is imported."""

import ast

import emaphm
from imports import tree_of


def named_for_type_checkers() -> dict[str, str]:
    """Return the names that `emaphm/__init__.py` imports for type checkers, each with its module."""
    (block,) = (node for node in tree_of("emaphm").body if isinstance(node, ast.If))
    imports = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    return {
        alias.name: node.module
        for node in imports
        for alias in node.names
        if node.module and node.module.startswith("emaphm")
    }


def test_each_public_name_has_one_module_also_for_type_checkers() -> None:
    assert named_for_type_checkers() == emaphm._HOME


def test_the_public_names_are_those_with_a_module_and_the_version() -> None:
    assert sorted(emaphm.__all__) == sorted([*emaphm._HOME, "__version__"])


def test_all_public_names_can_be_imported() -> None:
    assert all(getattr(emaphm, name) is not None for name in emaphm.__all__)


def test_names_are_listed_before_they_are_imported() -> None:
    assert set(emaphm.__all__) - set(vars(emaphm)) != set()
    assert set(emaphm.__all__) <= set(dir(emaphm))
