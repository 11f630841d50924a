"""Something to do once a library is there, without waiting for the library."""

import sys
from collections.abc import Callable
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import ModuleType


def after_import(library: str, action: Callable[[], object]) -> None:
    """Do something as soon as a library is imported: now, if it has been."""
    if library in sys.modules:
        action()
    else:
        sys.meta_path.insert(0, _Waiting(library, action))


# Gymnasium 1.4 reads no entry points of other packages, and to import it for its registry would
# take most of a second of everyone who does without. Hence this hook.
class _Waiting(MetaPathFinder):
    """Is asked for each module that Python imports, and is gone when the library has come."""

    def __init__(self, library: str, action: Callable[[], object]) -> None:
        self._library = library
        self._action = action

    def find_spec(
        self, fullname: str, _path: object, _target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Leave every module to the finders after this one, but listen to the library's loader."""
        if fullname != self._library:
            return None
        # Aside for a moment, so that the others are asked. It may be a look only, with no import.
        sys.meta_path.remove(self)
        try:
            spec = find_spec(fullname)
        finally:
            sys.meta_path.insert(0, self)
        if spec is None or spec.loader is None:
            return spec
        execute = spec.loader.exec_module

        def execute_and_act(module: ModuleType) -> None:
            execute(module)
            sys.meta_path.remove(self)
            self._action()

        # Of this loader alone: Python makes one for each module that it finds.
        spec.loader.exec_module = execute_and_act
        return spec
