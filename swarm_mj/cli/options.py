"""A dataclass as a command line: each option is a field, with its help, range and default.

tyro does this too, but refuses in boxes of several lines, knows no abbreviations and drops all but
the last of `--robots 10 --robots 20`.
"""

import argparse
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import MISSING, Field, dataclass, field, fields
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, NoReturn, TypeVar, get_origin

from swarm_mj.cli.option_values import reader_of
from swarm_mj.system.arguments import did_you_mean
from swarm_mj.system.exit_codes import BAD_INPUT
from swarm_mj.system.fields import (
    Meaning,
    as_typed,
    check,
    kind_of,
    meaning_of,
    range_of,
    setting,
)
from swarm_mj.system.streams import check_printable, in_a_line

Value = TypeVar("Value")
# What was typed, by the places of the options. Each value is of its option's type, which the parser
# has seen to and no type checker can know.
Given = dict[str, Any]

MANY = 10**9  # from here on, the end of a range is only there to catch slips
LEAST = 1e-9  # the beginning of a range that 0 alone does not belong to
METAVARS: dict[Any, str] = {int: "N", float: "X", str: "NAME", Path: "FILE"}
output_option = partial(setting, group="output")  # under this heading of the help
common_output = partial(output_option, is_common=True)
NESTED = "nested"  # the key of a field's metadata that several options fill


class Parser(argparse.ArgumentParser):
    """A parser that complains in one line, and whose help may leave out what few people need."""

    rare: Mapping[argparse.Action, str | None] = MappingProxyType({})  # what `--help-all` says
    sought: Mapping[str, str] = MappingProxyType({})  # flags that exist, by what is typed for them
    one_only: Mapping[str, str] = MappingProxyType({})  # hints for several values, by their flag

    def format_help(self) -> str:
        """Return the help; its last line says how to see the options that it leaves out."""
        if not self.rare:
            return super().format_help()
        titles: list[str] = []  # of groups that are left out whole
        for group in self._action_groups:
            actions = set(group._group_actions)
            if actions and actions <= self.rare.keys():
                title, _, _ = str(group.title).partition(",")
                titles.append(title)
        left_out = f"{self.prog} --help-all shows {len(self.rare)} more"
        named = f": {', '.join(titles)}" if titles else ""
        return f"{super().format_help()}\n{left_out}{named}\n"

    def known(self, arguments: Sequence[str]) -> argparse.Namespace:
        """Return the values typed; refuse an unknown flag and name the likely one."""
        for argument in arguments:
            if argument.startswith("-") and argument.endswith("=--"):  # argparse drops the dashes
                self.error(f"argument {argument.partition('=')[0]}: expected a value, not '--'")
        parsed, left = self.parse_known_args(arguments)
        if left:
            hint = self._hint_at(left[0], arguments)
            self.error(f"unrecognized arguments: {' '.join(left)}{hint}")
        return parsed

    def _hint_at(self, unknown: str, arguments: Sequence[str]) -> str:
        """Return how a complaint about an argument ends: by what is meant, if that is likely."""
        before = arguments[: arguments.index(unknown)] if unknown in arguments else ()
        typed_flags = [each.partition("=")[0] for each in before if each.startswith("-")]
        if typed_flags and not unknown.startswith("-") and typed_flags[-1] in self.one_only:
            return f"; {self.one_only[typed_flags[-1]]}"
        flags: list[str] = []
        for action in self._actions:
            flags.extend(action.option_strings)
        typed = unknown.partition("=")[0]
        meant = self.sought.get(typed)
        return f"; did you mean {meant}?" if meant else did_you_mean(typed, flags)

    def error(self, message: str) -> NoReturn:
        """Print the complaint and where to read on; exit with 2."""
        said = in_a_line(message)
        self.exit(BAD_INPUT, f"{self.prog}: error: {said} (see {self.prog} --help)\n")


class _HelpAll(argparse.Action):  # with the options that most people do not need
    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        assert isinstance(parser, Parser)
        for action, text in parser.rare.items():
            action.help = text
        parser.rare = {}
        parser.print_help()
        parser.exit()


class _Formatter(argparse.HelpFormatter):
    def _split_lines(self, text: str, width: int) -> list[str]:
        """Return lines in which names of policies stay whole."""
        return textwrap.wrap(" ".join(text.split()), width, break_on_hyphens=False)

    def _format_action_invocation(self, action: argparse.Action) -> str:
        """Return a flag without those that it had in earlier releases."""
        shown = copy(action)
        if shown.dest not in ("help", "help_all"):
            shown.option_strings = action.option_strings[:1]
        return super()._format_action_invocation(shown)

    def _format_args(self, action: argparse.Action, default_metavar: str | None) -> str:
        """Return `NAME ...` rather than argparse's `NAME [NAME ...]`."""
        if action.nargs == "+":
            return f"{action.metavar} ..."
        return super()._format_args(action, default_metavar or "")


@dataclass(frozen=True)
class Option:
    """A field as an option of the command line."""

    spec: Field[Any]
    about: Meaning  # what the help says of it: the field's own, unless the command says otherwise
    place: str  # what its value is called until it is built into the command's dataclass
    is_many: bool = False  # whether it takes several values
    is_nested: bool = False  # whether it is part of another field, which does without it

    @property
    def is_required(self) -> bool:
        """True if its flag must be typed."""
        can_lack = self.is_nested or self.about.is_positional
        return not can_lack and self.spec.default is MISSING


@dataclass(frozen=True)
class Nested:
    """A field that several options fill."""

    options: Callable[[], Iterable[Option]]
    build: Callable[[Given], Any]


def nested(options: Callable[[], Iterable[Option]], build: Callable[[Given], Value]) -> Value:
    """Return a field that several options fill; type checkers take it for what `build` makes.

    Args:
        options: Makes the options.
        build: Makes the field's value of all values given, by their places.
    """
    filled: Any = field(metadata={NESTED: Nested(options, build)})
    return filled


def parse_options(kind: type[Any], arguments: Sequence[str], prog: str, summary: str) -> object:
    """Return the command line as an instance of its dataclass, `kind`.

    Its `EPILOG`, if it has one, ends the help; a field `typed` takes the arguments themselves.
    Raises ValueError if a value is not among the choices, or out of range, or no name of a file;
    SystemExit if the options cannot be read, or help was asked for.
    """
    _check_names(arguments)
    parsed = vars(_parser_of(kind, prog, summary).known(arguments))
    given: Given = {"typed": tuple(arguments)}
    given |= {name: tuple(x) if isinstance(x, list) else x for name, x in parsed.items()}
    specs = fields(kind)
    values: Given = {}
    for spec in specs:
        filled = _nested_in(spec)
        if filled is not None:
            values[spec.name] = filled.build(given)
        elif spec.name in given:
            values[spec.name] = given[spec.name]
    options = kind(**values)
    check(options, _called)
    return options


def flags_of(spec: Field[Any]) -> tuple[str, ...]:
    """Return the flag of a field, `--windows` of `num_windows`, then those of earlier releases."""
    about = meaning_of(spec)
    name = spec.name.removeprefix("num_").removeprefix("is_")
    former = [_flag(each) for each in about.former]
    return (about.flag or _flag(name), *former)


def _called(spec: Field[Any]) -> str:
    """Return what messages call an option: its name in words, or else its flag."""
    about = meaning_of(spec)
    return about.label or (spec.name if about.is_positional else flags_of(spec)[0])


def _flag(name: str) -> str:
    return "--" + name.replace("_", "-")


def _check_names(arguments: Sequence[str]) -> None:
    """Raise ValueError for names that not all libraries or terminals take, or none could find."""
    try:
        names = (*arguments, str(Path.cwd()))
    except FileNotFoundError:
        raise ValueError("the current folder was deleted; change to another") from None
    for name in names:
        # Python smuggles bytes that it cannot decode through as lone surrogates; C++ cannot.
        if any("\udc80" <= character <= "\udcff" for character in name):
            encoding = sys.getfilesystemencoding()
            raise ValueError(f"{name!a} has bytes that are no {encoding}; rename it")
    for argument in arguments:
        check_printable(argument, "rename it")


def _parser_of(kind: type[Any], prog: str, summary: str) -> Parser:
    options = list(_options_of(kind))
    parser = Parser(
        prog=prog,
        usage=_usage(prog, options),
        description=summary,
        epilog=getattr(kind, "EPILOG", None),
        formatter_class=partial(_Formatter, max_help_position=26),
        argument_default=argparse.SUPPRESS,
    )
    if rare := _rare(kind, options):
        about = "show all options and exit"
        parser.add_argument("--help-all", action=_HelpAll, nargs=0, help=about)
    groups: dict[str, Any] = {"": parser}
    for option in options:
        heading = option.about.group
        if heading not in groups:
            groups[heading] = parser.add_argument_group(heading)
        _add(groups[heading], option)
    sought: dict[str, str] = {}
    one_only: dict[str, str] = {}
    for option in options:
        flag, *_ = flags_of(option.spec)
        sought |= dict.fromkeys(option.about.sought_as, flag)
        if option.about.one_only:
            one_only[flag] = option.about.one_only
    parser.sought = sought
    parser.one_only = one_only
    parser.rare = {action: action.help for action in parser._actions if action.dest in rare}
    for action in parser.rare:
        action.help = argparse.SUPPRESS
    return parser


def _usage(prog: str, options: Iterable[Option]) -> str:
    """Return a command's first line of help: what stands without a flag, then what is needed."""
    bare: list[str] = []
    needed: list[str] = []
    for option in options:
        value = _metavar(option)
        if option.about.is_positional:
            bare.append(value if option.spec.default is MISSING else f"[{value}]")
        elif option.is_required:
            needed.append(f"{flags_of(option.spec)[0]} {value}")
    return " ".join([prog, *bare, *needed, "[OPTIONS]"])


def _options_of(kind: type[Any]) -> Iterator[Option]:
    """Yield the options of a command's dataclass: its fields, and those nested in them."""
    for spec in fields(kind):
        about = meaning_of(spec)
        if filled := _nested_in(spec):
            yield from filled.options()
        elif about.help:
            yield Option(spec, about, place=spec.name)


def _nested_in(spec: Field[Any]) -> Nested | None:
    return spec.metadata.get(NESTED)


def _rare(kind: type[Any], options: Sequence[Option]) -> frozenset[str]:
    """Return the places of options that are not common, if the command says which are."""
    if not any(meaning_of(spec).is_common for spec in fields(kind)):
        return frozenset()
    rare: set[str] = set()
    for option in options:
        is_shown = option.is_required or option.about.is_common or option.about.is_positional
        if not is_shown:
            rare.add(option.place)
    return frozenset(rare)


def _add(group: argparse._ActionsContainer, option: Option) -> None:
    spec = option.spec
    about = option.about
    kind = kind_of(spec)
    flags = flags_of(spec)
    how: dict[str, Any] = {"help": _help(option)}
    if kind is bool:
        group.add_argument(*flags, dest=option.place, action="store_true", **how)
        return
    how["type"] = about.convert or reader_of(spec)
    how["metavar"] = _metavar(option)
    if about.bare is not None:
        how |= {"nargs": "?", "const": about.bare}
    if option.is_many or get_origin(spec.type) is tuple:
        how |= {"nargs": "+", "action": "extend"}
    if not about.is_positional:
        group.add_argument(*flags, dest=option.place, required=option.is_required, **how)
        return
    if spec.default is not MISSING:
        how["nargs"] = "?"
    group.add_argument(option.place, **how)


def _help(option: Option) -> str:
    """Return meaning, choices, unit, range and default."""
    spec = option.spec
    about = option.about
    text = about.help
    if about.choices:
        text += f": {', '.join(about.choices)}"
    if about.high is not None:
        has_end = about.high < MANY
        if has_end:
            text += f", {range_of(spec)}"
        elif about.low == LEAST:
            text += ", more than 0"
        else:
            text += f", {about.low} or more"
    default = about.shown
    if default is None:
        has_default = not any(spec.default is each for each in (MISSING, None, False, ()))
        default = as_typed(spec.default) if has_default else ""
    if default:
        text += f" (default: {default})"
    return text.replace("%", "%%")


def _metavar(option: Option) -> str:
    return option.about.metavar or METAVARS.get(kind_of(option.spec), "VALUE")
