"""Public names that are declared in a stub and imported when they are first asked for.

This is the idea of SPEC 1 of scientific Python. Type checkers, editors and the package itself read
one list, so a name is not written once for each of them.
"""

import ast
from collections.abc import Callable
from importlib import import_module


def attach_stub(
    package: str, file: str
) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """Return what a package needs to have the names that its stub imports.

    Args:
        package: The package's `__name__`.
        file: Its `__file__`; the stub lies beside it, and ends in `.pyi`.

    Returns:
        The package's `__getattr__`, `__dir__` and `__all__`.
    """
    homes = imported_names(file + "i")

    def get(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name)
        return getattr(import_module(homes[name]), name)

    def names() -> list[str]:
        return sorted({*vars(import_module(package)), *homes})

    return get, names, sorted(homes)


def imported_names(stub: str) -> dict[str, str]:
    """Return the module of each name that a stub imports."""
    with open(stub, encoding="utf-8") as text:
        tree = ast.parse(text.read())
    homes: dict[str, str] = {}
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and node.module:
            for each in node.names:
                homes[each.name] = node.module
    return homes
