"""Checks of types and shapes in each function's first calls of a test.

To check every call takes twice the time of the tests themselves, for simulations make the same
calls over and over.
"""

import sys
from collections import Counter
from functools import reduce, wraps

from beartype import BeartypeConf, beartype

CHECKED_CALLS = 3  # of each function in a test
# A whole number is a float, as type checkers have it (PEP 484): missions turn it into one.
RULES = BeartypeConf(is_pep484_tower=True)

_calls = Counter()  # in this test, by function; of arguments and of results apart
_over = []  # the functions that are no longer checked in this test


def sampled(function):
    """A type checker for jaxtyping's import hook: beartype, for the first calls only."""
    check_always = beartype(conf=RULES)(function)

    @wraps(function)
    def check(*args, **kwargs):
        _calls[check] += 1
        if _calls[check] == CHECKED_CALLS:
            _leave_alone(function)
        return check_always(*args, **kwargs)

    return check


def check_again():
    """Begins a new test: all functions are checked."""
    _calls.clear()
    while _over:
        _over.pop().__no_type_check__ = False


def _leave_alone(function):
    """Marks the function of this name, which jaxtyping then calls as it is."""
    path = function.__qualname__.split(".")
    if "<locals>" in path:
        return
    found = reduce(lambda owner, name: vars(owner)[name], path, sys.modules[function.__module__])
    found = getattr(found, "fget", None) or getattr(found, "__func__", found)
    found.__no_type_check__ = True
    _over.append(found)
