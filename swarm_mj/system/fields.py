"""Fields that say what they mean: name, unit, source, range and help stand beside the value.

A dataclass of such fields is the settings, their documentation and, in `cli.options`, the command
line at once.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass, replace
from functools import cache, partial
from numbers import Integral, Real
from pathlib import Path
from types import MappingProxyType, NoneType
from typing import Any, Literal, TypedDict, TypeVar, Unpack, cast, get_args, get_origin

import numpy as np

from swarm_mj.system.arguments import check_choice

Value = TypeVar("Value")

# What an annotation admits, NumPy's numbers included, and how a message calls it.
KINDS: dict[Any, tuple[type, str]] = {
    int: (Integral, "a whole number"),
    float: (Real, "a number"),
    bool: (bool, "True or False"),
}
# Until when former names and options that are ignored still work, for help and documentation.
GONE_IN = "version 2.0, not before 2027-12-01"
REQUIRED: Any = MISSING  # the default of a field whose value must be given
ABOUT = "about"  # the one key of a field's metadata


def joined_by_commas(text: str) -> list[str]:
    """Return the choices that a text joins."""
    return text.split(",")


@dataclass(frozen=True)
class Switch:
    """The state of another field for a field to count: a number above 0, or a text."""

    field: Field[Any]
    state: str = ""  # a text that it may be; "" is any number above 0
    others: tuple[str, ...] = ()  # texts besides which it must have another one
    parts: Callable[[str], list[str]] = joined_by_commas  # those of which a text is made

    @property
    def name(self) -> str:
        """The name of the other field."""
        return self.field.name

    def is_on(self, settings: object) -> bool:
        """Return whether it is so in some settings; of joined choices, one is enough."""
        value = getattr(settings, self.name)
        if self.others:
            return any(part not in self.others for part in self.parts(value))
        return self.state in self.parts(value) if self.state else value > 0

    @property
    def needed(self) -> str:
        """The state that the other field needs, in words."""
        if self.others:
            return f"other than {' or '.join(self.others)}"
        return self.state or "above 0"


@dataclass(frozen=True, kw_only=True)
class Meaning:
    """The meaning of a field: what messages, help, documentation and checks say of it.

    Raises TypeError for a range that has one end only.
    """

    help: str = ""  # on the command line; without it, the field is no option
    label: str = ""  # its name in words, for messages; its name in Python unless given
    unit: str = ""  # of its number, as it is printed in brackets
    source: str = ""  # where the default comes from, such as an equation of the paper
    low: float | int | None = None  # the least number that is allowed
    high: float | int | None = None  # the largest; both ends are given, or none
    choices: Collection[str] = ()  # the texts that are allowed, if not all are
    is_joined: bool = False  # whether several choices may be joined by commas
    # What must be on for this to count: see `above_zero`, `set_to` and `other_than`.
    counts_with: Switch | None = None
    former: tuple[str, ...] = ()  # its names in earlier releases, in files and on command lines
    group: str = ""  # the heading that it stands under in the help
    metavar: str = ""  # what stands for its value in the help
    shown: str | None = None  # what the help says in place of the default; "" is nothing
    flag: str = ""  # its option, if that is not made from its name
    convert: Callable[[str], object] | None = None  # makes the value of what was typed
    reads: Callable[[Any], Iterable[Path]] | None = None  # files to read that a value names
    bare: str | None = None  # its value if the flag is typed without one; None: it needs one
    sought_as: tuple[str, ...] = ()  # flags typed for it that are none; a message leads here
    one_only: str = ""  # what a message says to those who type several values where one is taken
    is_positional: bool = False  # whether the option has no flag
    is_common: bool = False  # whether `--help` shows it, and does not leave it to `--help-all`

    def __post_init__(self) -> None:
        if (self.low is None) != (self.high is None):
            raise TypeError(f"a range needs both ends, not low={self.low} and high={self.high}")

    @property
    def has_range(self) -> bool:
        """True if numbers have to lie between two ends."""
        return self.low is not None


class MeaningFields(TypedDict, total=False):
    """The fields of `Meaning` but for the help, as type checkers read them; a test compares."""

    label: str
    unit: str
    source: str
    low: float | int | None
    high: float | int | None
    choices: Collection[str]
    is_joined: bool
    counts_with: Switch | None
    former: tuple[str, ...]
    group: str
    metavar: str
    shown: str | None
    flag: str
    convert: Callable[[str], object] | None
    reads: Callable[[Any], Iterable[Path]] | None
    bare: str | None
    sought_as: tuple[str, ...]
    one_only: str
    is_positional: bool
    is_common: bool


def setting(default: Value = REQUIRED, help: str = "", **meaning: Unpack[MeaningFields]) -> Value:
    """Return a dataclass's field that says what it means; type checkers take it for its default.

    Args:
        default: Its value unless given; without a default, it must be given.
        help: What it means on the command line; without it, the field is no option.
        **meaning: What else there is to say of it: see `Meaning`.

    Raises:
        TypeError: A range has one end only, or `Meaning` has no such field.
    """
    return field(default=default, metadata={ABOUT: Meaning(help=help, **meaning)})


# An option that `--help` shows and does not leave to `--help-all`.
common_setting = partial(setting, is_common=True)


def above_zero(switch: object) -> Switch:
    """Return that a field counts where another one of its class is above 0.

    In the body of a class, the name of another field is that field itself, so that no misspelt
    name gets past a type checker, nor past the import. Raises TypeError for what is no `setting`.
    """
    if not isinstance(switch, Field) or not meaning_of(switch).has_range:
        raise TypeError(f"counts_with needs a number that is a `setting`, not {switch!r:.80}")
    return Switch(switch)


def set_to(switch: object, state: str) -> Switch:
    """Return that a field counts where another one, as of `above_zero`, is set to a choice."""
    choices = meaning_of(switch).choices if isinstance(switch, Field) else ()
    if not isinstance(switch, Field) or state not in choices:
        raise TypeError(f"counts_with needs one of {', '.join(choices)}, not {state!r}")
    return Switch(switch, state)


def other_than(
    switch: object, *others: str, parts: Callable[[str], list[str]] = joined_by_commas
) -> Switch:
    """Return that a field counts where another one, as of `above_zero`, is a text but these.

    Where its text has several `parts`, one that is another is enough.
    """
    if not isinstance(switch, Field) or not isinstance(switch.default, str):
        raise TypeError(f"counts_with needs a text that is a `setting`, not {switch!r:.80}")
    return Switch(switch, others=others, parts=parts)


def meaning_of(spec: Field[Any]) -> Meaning:
    """Return what a dataclass's field says of itself; nothing, if it is no `setting`."""
    return spec.metadata.get(ABOUT, Meaning())


def same_as(owner: type[Any], name: str, *, is_common: bool | None = None) -> Any:  # noqa: ANN401 - as the other field's value
    """Return a field like another dataclass's: its default, meaning and range.

    `is_common` says otherwise than the other field whether `--help` always shows it.
    """
    spec = owner.__dataclass_fields__[name]
    about = meaning_of(spec)
    if is_common is not None:
        about = replace(about, is_common=is_common)
    return field(default=spec.default, metadata={ABOUT: about})


@cache
def former_names(*kinds: type[Any]) -> Mapping[str, str]:
    """Return the present names of dataclasses' fields by those that they had in earlier releases.

    Stored files are read with either name; command lines take both; Python takes the new one, and
    a message leads there. docs/options.md lists them.
    """
    present: dict[str, str] = {}
    for kind in kinds:
        for spec in fields(kind):
            for former in meaning_of(spec).former:
                present[former] = spec.name
    return MappingProxyType(present)


def own_label(spec: Field[Any]) -> str:
    """Return what messages call a field: its name in words, or else in Python."""
    return meaning_of(spec).label or spec.name


def check(
    settings: Any,  # noqa: ANN401 - any dataclass
    called: Callable[[Field[Any]], str] = own_label,
) -> None:
    """Raise ValueError unless every field's value is of its kind and in its range or choices.

    The message names the field as it is `called`, what is allowed, and the value. NumPy's numbers,
    which JSON does not know, become Python's, and whole numbers floats where those are meant.
    """
    for spec in fields(settings):
        value = getattr(settings, spec.name)
        if value is None and NoneType in get_args(spec.type):
            continue
        has_many = get_origin(spec.type) is tuple
        given: tuple[Any, ...] = value if has_many and isinstance(value, tuple) else (value,)
        for each in given:
            check_value(spec, each, called(spec))
        plain = tuple(each.item() if isinstance(each, np.generic) else each for each in given)
        if kind_of(spec) is float:
            plain = tuple(map(float, plain))
        object.__setattr__(settings, spec.name, plain if has_many else plain[0])


def the_file(path: Path) -> list[Path]:
    """Return the one file that is named: what a field `reads` whose value is a path."""
    return [path]


def files_read(settings: Any) -> Iterator[Path]:  # noqa: ANN401 - any dataclass
    """Yield the files that a dataclass's fields, and those nested in them, name to be read."""
    for spec in fields(settings):
        reads = meaning_of(spec).reads
        value = getattr(settings, spec.name)
        for each in value if isinstance(value, tuple) else (value,):
            if is_dataclass(each):
                yield from files_read(each)
            elif reads is not None and each is not None:
                yield from reads(each)


def kind_of(spec: Field[Any]) -> object:
    """Return the type of a single value: `int` of `int`, `int | None` and `tuple[int, ...]`."""
    if get_origin(spec.type) is Literal:
        return str
    kinds = [kind for kind in get_args(spec.type) if kind not in (NoneType, Ellipsis)]
    return kinds[0] if kinds else spec.type


def range_of(spec: Field[Any]) -> str:
    """Return a field's allowed numbers and their unit, in words."""
    about = meaning_of(spec)
    ends = f"{as_typed(about.low)} to {as_typed(about.high)}"
    return f"{ends} [{about.unit}]" if about.unit else ends


def numbers_of(spec: Field[Any]) -> str:
    """Return which numbers a field takes, in words: their kind, and their range if there is one."""
    _, described = KINDS.get(kind_of(spec), (object, ""))
    return f"{described} from {range_of(spec)}" if meaning_of(spec).has_range else described


def as_typed(value: object) -> str:
    """Return a setting's value as it is typed."""
    if isinstance(value, tuple):
        return " ".join(map(as_typed, value))
    if value is None:
        return "none"
    return f"{value:g}" if isinstance(value, float) and float(f"{value:g}") == value else str(value)


def check_value(spec: Field[Any], value: object, called: str = "") -> None:
    """Check one value of a field, which may be `called` otherwise where it was given."""
    about = meaning_of(spec)
    label = called or own_label(spec)
    kind, _ = KINDS.get(kind_of(spec), (object, ""))
    if about.choices:
        check_choice(label, value, about.choices, is_joined=about.is_joined)
    is_bool = isinstance(value, bool)  # Python's True is 1
    is_allowed = isinstance(value, kind) and (not is_bool or kind in (bool, object))
    if about.low is not None and about.high is not None:
        is_number = isinstance(value, Real)
        is_allowed &= is_number and about.low <= cast("float", value) <= about.high
    if not is_allowed:
        shown = repr(value) if isinstance(value, str) else value
        raise ValueError(f"{label} must be {numbers_of(spec)}, not {shown}")
