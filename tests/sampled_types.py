"""Checks of types and shapes in each function's first calls of a test.

To check every call took twice the time of the tests themselves, for simulations make the same calls
over and over.
"""

import sys
from functools import reduce, wraps

from beartype import beartype

CHECKS = 16  # of each function in a test; two a call: of arguments, and with the result

_over = []  # the functions that are no longer checked in this test


def sampled(function):
    """A type checker for jaxtyping's import hook: beartype, for the first calls only."""
    check_all = beartype(function)
    num_checks = 0

    @wraps(function)
    def check(*args, **kwargs):
        nonlocal num_checks
        num_checks += 1
        if num_checks > CHECKS:
            num_checks = 0
            _leave_alone(function)
        return check_all(*args, **kwargs)

    return check


def check_again():
    """Begins a new test: all functions are checked."""
    while _over:
        _over.pop().__no_type_check__ = False


def _leave_alone(function):
    """Marks the function of this name, which jaxtyping then calls as it is."""
    path = function.__qualname__.split(".")
    if "<locals>" in path:
        return
    module = sys.modules[function.__module__]
    found = reduce(lambda owner, name: vars(owner)[name], path, module)
    found = getattr(found, "fget", None) or getattr(found, "__func__", found)
    found.__no_type_check__ = True
    _over.append(found)
