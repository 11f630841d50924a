"""Fields that say what they mean: name, unit, source, range and help stand beside the value.

A dataclass of such fields is the settings, their documentation and, in `cli.options`, the command
line at once.
"""

import inspect
from collections.abc import Collection, Iterable
from dataclasses import MISSING, Field, field, fields
from difflib import get_close_matches
from functools import partial
from numbers import Integral, Real
from types import NoneType
from typing import Any, Literal, get_args, get_origin

import numpy as np

# What an annotation admits, NumPy's numbers included, and how a message calls it.
KINDS: dict[Any, tuple[type, str]] = {
    int: (Integral, "a whole number"),
    float: (Real, "a number"),
    bool: (bool, "True or False"),
}
# Until when former names and options that are ignored still work, for help and documentation.
GONE_IN = "version 2.0, not before 2027-12-01"
# Fields by the names that they once had. Stored files are read with either name; command lines take
# both; Python gets the new one. docs/options.md lists them.
FORMER_NAMES = {
    "known": "prior_knowledge",
    "switched_off": "failure_fraction",
    "strong_share": "high_power_fraction",
    "strong_db": "high_power_db",
    "parts": "components",
    "arm": "credit_assignment",
}
FieldOf = Any  # what a field's maker returns: type checkers take it for the attribute's value


def setting(default: object = MISSING, help: str = "", **metadata: Any) -> FieldOf:
    """Return a field that says what it means; without a default, its value must be given.

    `help` says what it means on the command line; without it, the field is no option. The metadata
    are `label`, the name in words; `unit`; `source`, where the default comes from; `low` and
    `high`, the range; `choices`, and `is_joined` where several may be joined by commas; and what
    `cli.options` shows: `group`, the heading it stands under; `metavar`; `shown`, the default in
    words; `is_positional`, for an option without a flag; `is_common`, for those that
    `--help` shows and does not leave to `--help-all`; `flag`, if it is not made from the name;
    `convert`, which makes a value of what was typed.
    """
    return field(default=default, metadata=metadata | ({"help": help} if help else {}))


# An option that `--help` shows and does not leave to `--help-all`.
common_setting = partial(setting, is_common=True)


def same_as(owner: type[Any], name: str) -> FieldOf:
    """Return a field like another dataclass's: its default, meaning and range."""
    spec = owner.__dataclass_fields__[name]
    return field(default=spec.default, metadata=spec.metadata)


def check(settings: Any) -> None:  # noqa: ANN401 - any dataclass
    """Raise ValueError unless every field's value is of its kind and in its range or choices.

    The message names the field, what is allowed, and the value. NumPy's numbers, which JSON does
    not know, become Python's, and whole numbers floats where those are meant.
    """
    for spec in fields(settings):
        value = getattr(settings, spec.name)
        if value is None and NoneType in get_args(spec.type):
            continue
        has_many = get_origin(spec.type) is tuple
        given: tuple[Any, ...] = value if has_many and isinstance(value, tuple) else (value,)
        for each in given:
            check_value(spec, each)
        plain = tuple(each.item() if isinstance(each, np.generic) else each for each in given)
        if kind_of(spec) is float:
            plain = tuple(map(float, plain))
        object.__setattr__(settings, spec.name, plain if has_many else plain[0])


def kind_of(spec: Field[Any]) -> object:
    """Return the type of a single value: `int` of `int`, `int | None` and `tuple[int, ...]`."""
    if get_origin(spec.type) is Literal:
        return str
    kinds = [kind for kind in get_args(spec.type) if kind not in (NoneType, Ellipsis)]
    return kinds[0] if kinds else spec.type


def range_of(spec: Field[Any]) -> str:
    """Return a field's allowed numbers and their unit, in words."""
    ends = " to ".join(as_typed(spec.metadata[end]) for end in ("low", "high"))
    return f"{ends} [{spec.metadata['unit']}]" if "unit" in spec.metadata else ends


def as_typed(value: object) -> str:
    """Return a setting's value as it is typed."""
    if isinstance(value, tuple):
        return " ".join(map(as_typed, value))
    if value is None:
        return "none"
    return f"{value:g}" if isinstance(value, float) and float(f"{value:g}") == value else str(value)


def did_you_mean(typed: object, known: Iterable[str]) -> str:
    """End a complaint about an unknown name: the known one most like it, or nothing."""
    names = {name.lstrip("-"): name for name in known}  # flags are not alike for their dashes
    bare = str(typed).lstrip("-")
    likely = [new for new in names if new == FORMER_NAMES.get(bare)]
    likely += [name for name in names if bare in name.split("_")[1:]]  # windows of num_windows
    likely += get_close_matches(bare, names, n=1)
    return f"; did you mean {names[likely[0]]}?" if likely else ""


def check_names(what: str, given: Iterable[str], known: Iterable[str]) -> None:
    """Raise TypeError, in Python's words, which TorchRL reads, for a keyword that is not known."""
    known = list(known)
    for name in given:
        if name not in known:
            hint = did_you_mean(name, known) or f"; it has {', '.join(known)}"
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


def _shown(value: object) -> str:
    """Return a wrong argument, and what to do about a class in place of its object."""
    if isinstance(value, type):
        return f"the class {value.__name__}; make an object of it, {value.__name__}(...)"
    return f"{value!r:.80}"


def check_value(spec: Field[Any], value: object, called: str = "") -> None:
    """Check one value of a field, which may be `called` otherwise where it was given."""
    allowed = spec.metadata
    label = called or allowed.get("label", spec.name)
    kind, described = KINDS.get(kind_of(spec), (object, ""))
    if "choices" in allowed:
        check_choice(label, value, allowed["choices"], is_joined=allowed.get("is_joined", False))
    is_number = not isinstance(value, bool)  # Python's True is 1
    is_allowed = isinstance(value, kind) and (is_number or kind in (bool, object))
    limits = ""
    if "low" in allowed:
        is_allowed &= isinstance(value, Real) and allowed["low"] <= value <= allowed["high"]
        limits = f" from {range_of(spec)}"
    if not is_allowed:
        shown = repr(value) if isinstance(value, str) else value
        raise ValueError(f"{label} must be {described}{limits}, not {shown}")


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
