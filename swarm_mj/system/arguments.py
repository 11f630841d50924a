"""Refusals of arguments, in one line each: what is wrong, what is allowed, what may be meant."""

import inspect
from collections.abc import Collection, Iterable, Mapping
from difflib import get_close_matches
from functools import partial
from types import MappingProxyType
from typing import Any, TypeVar, cast

Choice = TypeVar("Choice", bound=str)
NO_NAMES: Mapping[str, str] = MappingProxyType({})


def check_choice(
    label: str, value: object, choices: Collection[str], *, is_joined: bool = False
) -> None:
    """Raise ValueError unless a value is one of the choices, or some of them joined by commas."""
    typed = [value]
    if is_joined and isinstance(value, str):
        typed = [each.strip() for each in value.split(",")]
    for each in typed:
        if each not in choices:
            joined = ", or several joined by commas" if is_joined else ""
            rule = f"{label} must be one of {', '.join(choices)}{joined}"
            raise ValueError(f"{rule}, not {each!r}{did_you_mean(each, choices)}")


def checked_choice(label: str, value: object, choices: Collection[Choice]) -> Choice:
    """Return a value as one of the choices, for type checkers too; ValueError for any other."""
    check_choice(label, value, choices)
    return cast("Choice", value)


def did_you_mean(typed: object, known: Iterable[str], former: Mapping[str, str] = NO_NAMES) -> str:
    """End a complaint about an unknown name: the known one most like it, or nothing.

    Args:
        typed: The unknown name.
        known: Those that are known.
        former: Those that were known, and what they are called now.
    """
    names = {name.lstrip("-"): name for name in known}  # flags are not alike for their dashes
    bare = str(typed).lstrip("-")
    likely = [name for name in names if name == former.get(bare)]
    likely += [name for name in names if bare in name.split("_")[1:]]  # windows of num_windows
    likely += get_close_matches(bare, names, n=1)
    return f"; did you mean {names[likely[0]]}?" if likely else ""


def check_names(
    what: str,
    given: Iterable[str],
    known: Iterable[str],
    former: Mapping[str, str] = NO_NAMES,
) -> None:
    """Raise TypeError, in Python's words, which TorchRL reads, for a keyword that is not known."""
    known = list(known)
    for name in given:
        if name not in known:
            hint = did_you_mean(name, known, former) or f"; it has {', '.join(known)}"
            raise TypeError(f"{what} got an unexpected keyword argument {name!r}{hint}")


def check_kind(
    what: str, value: object, kinds: type[Any] | tuple[type[Any], ...], such_as: str
) -> None:
    """Pass if an argument is of a kind; raise TypeError, naming one that is, if not."""
    if not isinstance(value, kinds):
        allowed = kinds if isinstance(kinds, tuple) else (kinds,)
        names = " or ".join(kind.__name__ for kind in allowed)
        rule = f"{what} must be of the type {names}, such as {such_as}"
        raise TypeError(f"{rule}, not {_shown(value)}")


def name_of(part: object) -> str:
    """Return the name of a function or a class, or of an object's class, for messages."""
    part = unwrapped(part)
    return getattr(part, "__name__", type(part).__name__)


def unwrapped(part: object) -> object:
    """Return the function or class that a partial one is made of."""
    while isinstance(part, partial):
        part = part.func
    return part


def check_callable(what: str, value: object, takes: tuple[str, ...]) -> None:
    """Raise TypeError unless an argument is callable with these arguments."""
    if isinstance(value, type) or not callable(value):
        raise TypeError(f"{what} must be a function, or an object like one, not {_shown(value)}")
    try:
        signature = inspect.signature(value)
    except (TypeError, ValueError):  # of what is not Python's own
        return
    try:
        signature.bind(*takes)
    except TypeError as error:
        rule = f"a {what} is called with ({', '.join(takes)})"
        raise TypeError(f"{rule}, but this one takes {signature}") from error


def check_component(what: str, value: object, takes: tuple[str, ...]) -> None:
    """Raise TypeError unless a part of a mission can be called so, and started if it has `start`.

    `mission.batched_rng.Started` says what `start` is for.
    """
    check_callable(what, value, takes)
    start = getattr(value, "start", None)
    if start is not None:
        check_callable(f"{what}'s start", start, ("num_robots", "rngs"))


def _shown(value: object) -> str:
    """Return a wrong argument, and what to do about a class in place of its object."""
    if isinstance(value, type):
        return f"the class {value.__name__}; make an object of it, {value.__name__}(...)"
    return f"{' '.join(repr(value).split()):.80}"  # an array takes several lines
