"""A dataclass as a command line: each option is a field, with its help, range and default.

tyro does this too, but refuses in boxes of several lines, knows no abbreviations and drops all but
the last of `--robots 10 --robots 20`.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import MISSING, Field, field, fields
from functools import partial
from pathlib import Path
from typing import Any, NoReturn, TypeVar, get_origin

from swarm_mj.system.exit_codes import BAD_INPUT
from swarm_mj.system.fields import FieldOf, as_typed, check, did_you_mean, kind_of, range_of

Options = TypeVar("Options")
MANY = 10**9  # from here on, the end of a range is only there to catch slips
METAVARS: dict[Any, str] = {int: "N", float: "X", str: "NAME", Path: "FILE"}


def _path(text: str) -> Path:
    """What was typed as a path; nothing at all would be the current folder."""
    if not text:
        raise argparse.ArgumentTypeError("name a file or a folder, not ''")
    return Path(text)


def _bit_rate(text: str) -> float | None:
    """Return a rate such as 250000, 250k or 6M, or `none`."""
    if text.lower() == "none":
        return None
    unit = BIT_RATES.get(text[-1:].lower(), 1.0)
    try:
        return float(text if unit == 1.0 else text[:-1]) * unit
    except ValueError:
        example = "250k, 1M or none"
        raise argparse.ArgumentTypeError(f"name bits per second, {example}, not {text!r}") from None


BIT_RATES = {"k": 1e3, "m": 1e6, "g": 1e9}  # what a letter behind a number stands for
# What makes a value of what was typed, by the value's type or unit.
CONVERT: dict[Any, Callable[[str], Any]] = {Path: _path, "bit/s": _bit_rate}


class Parser(argparse.ArgumentParser):
    """Complains in one line."""

    def known(self, arguments: Sequence[str]) -> argparse.Namespace:
        """What was typed, all of it known; of what is not, the likely flag is named."""
        parsed, left = self.parse_known_args(arguments)
        if left:
            flags = [flag for action in self._actions for flag in action.option_strings]
            hint = did_you_mean(left[0].partition("=")[0], flags)
            self.error(f"unrecognized arguments: {' '.join(left)}{hint}")
        return parsed

    def error(self, message: str) -> NoReturn:
        """Print the complaint and where to read on; exits with 2."""
        self.exit(BAD_INPUT, f"{self.prog}: error: {message} (see {self.prog} --help)\n")


class _Formatter(argparse.HelpFormatter):
    def _format_args(self, action: argparse.Action, default_metavar: str | None) -> str:
        """`NAME ...` rather than `NAME [NAME ...]`."""
        return (
            f"{action.metavar} ..."
            if action.nargs == "+"
            else super()._format_args(action, default_metavar or "")
        )


def nested(
    add: Callable[[argparse.ArgumentParser], None], build: Callable[[dict[str, Any]], Any]
) -> FieldOf:
    """Return a field of several options, which `add` declares; `build` makes it of those given."""
    return field(metadata={"add": add, "build": build})


def parse(kind: type[Options], arguments: Sequence[str], prog: str, summary: str) -> Options:
    """Return the command line as an instance of its dataclass.

    Args:
        kind: The dataclass; its `EPILOG`, if it has one, ends the help, and a field called `typed`,
            if it has one, takes the arguments themselves.
        arguments: What was typed after the command.
        prog: How the command is called.
        summary: What it does.

    Raises:
        ValueError: A value is not among the choices, or out of range, or no name of a file.
        SystemExit: The options cannot be read, or help was asked for.
    """
    _check_names(arguments)
    parsed = vars(_parser_of(kind, prog, summary).known(arguments))
    given: dict[str, Any] = {"typed": tuple(arguments), **parsed}
    values: dict[str, Any] = {}
    for spec in fields(kind):  # pyright: ignore[reportArgumentType]
        if "build" in spec.metadata:
            values[spec.name] = spec.metadata["build"](given)
        elif spec.name in given:
            value = given[spec.name]
            values[spec.name] = tuple(value) if isinstance(value, list) else value
    options = kind(**values)
    check(options)
    return options


def _check_names(arguments: Sequence[str]) -> None:
    """Raise ValueError for a name that not all libraries could open, or none could find."""
    try:
        names = (*arguments, str(Path.cwd()))
    except FileNotFoundError:
        raise ValueError("the current folder was deleted; change to another") from None
    for name in names:
        if any("\udc80" <= character <= "\udcff" for character in name):
            encoding = sys.getfilesystemencoding()
            raise ValueError(f"{name!a} has bytes that are no {encoding}; rename it")


def _parser_of(kind: type[Any], prog: str, summary: str) -> Parser:
    specs = fields(kind)
    needed = [_positional(spec) for spec in specs if spec.metadata.get("is_positional")]
    needed += [f"{flag_of(spec)} {_metavar(spec)}" for spec in specs if _is_required(spec)]
    parser = Parser(
        prog=prog,
        usage=" ".join([prog, *needed, "[OPTIONS]"]),
        description=summary,
        epilog=getattr(kind, "EPILOG", None),
        formatter_class=partial(_Formatter, max_help_position=26),
        argument_default=argparse.SUPPRESS,
    )
    declare(parser, kind)
    return parser


def declare(parser: argparse.ArgumentParser, kind: type[Any]) -> None:
    """Declare the fields of a command's dataclass as options of a parser."""
    groups: dict[str, Any] = {"": parser}
    for spec in fields(kind):
        if "add" in spec.metadata:
            spec.metadata["add"](parser)
        elif "help" in spec.metadata:
            title = spec.metadata.get("group", "")
            if title not in groups:
                groups[title] = parser.add_argument_group(title)
            default, is_required = _shown_default(spec), _is_required(spec)
            add_option(groups[title], spec, spec.name, default, is_required=is_required)


def add_option(
    group: argparse._ActionsContainer,
    spec: Field[Any],
    dest: str,
    default: str,
    *,
    is_many: bool = False,
    is_required: bool = False,
) -> None:
    """Declare a field as an option of a parser, or of a group of it.

    Args:
        group: The parser, or the group.
        spec: The field.
        dest: The value's name among those parsed; absent if the option was not given.
        default: The default as text; empty for none.
        is_many: Whether it takes several values, after one flag or several.
        is_required: Whether it must be given.
    """
    text, kind, known = _help(spec, default), kind_of(spec), spec.metadata
    if kind is bool:
        group.add_argument(flag_of(spec), dest=dest, action="store_true", help=text)
        return
    how: dict[str, Any] = {
        "type": known.get("convert") or CONVERT.get(known.get("unit")) or CONVERT.get(kind, kind),
        "metavar": _metavar(spec),
        "help": text,
    }
    if is_many or get_origin(spec.type) is tuple:
        how |= {"nargs": "+", "action": "extend"}
    if not known.get("is_positional"):
        added = group.add_argument(flag_of(spec), dest=dest, required=is_required, **how)
    elif spec.default is MISSING:
        added = group.add_argument(dest, **how)
    else:
        added = group.add_argument(dest, nargs="?", **how)
    vars(added)["spec"] = spec  # for who completes what is typed


def flag_of(spec: Field[Any]) -> str:
    """Return the flag of a field: `--windows` of `num_windows`."""
    name = spec.name.removeprefix("num_").removeprefix("is_")
    return "--" + name.replace("_", "-")


def _shown_default(spec: Field[Any]) -> str:
    """Return a default as text; empty if there is none to show."""
    if "shown" in spec.metadata:
        return spec.metadata["shown"]
    has_none = any(spec.default is nothing for nothing in (MISSING, None, False, ()))
    return "" if has_none else as_typed(spec.default)


def _help(spec: Field[Any], default: str) -> str:
    """Meaning, choices, unit, range, default."""
    allowed = spec.metadata
    text = allowed["help"]
    if "choices" in allowed:
        text += f": {', '.join(allowed['choices'])}"
    if "low" in allowed:
        has_end = allowed["high"] < MANY
        text += f", {range_of(spec)}" if has_end else f", {allowed['low']} or more"
    return (text + (f" (default: {default})" if default else "")).replace("%", "%%")


def _metavar(spec: Field[Any]) -> str:
    return spec.metadata.get("metavar") or METAVARS.get(kind_of(spec), "VALUE")


def _positional(spec: Field[Any]) -> str:
    return _metavar(spec) if spec.default is MISSING else f"[{_metavar(spec)}]"


def _is_required(spec: Field[Any]) -> bool:
    is_option = "help" in spec.metadata and not spec.metadata.get("is_positional")
    return is_option and spec.default is MISSING
