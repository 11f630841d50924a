"""Completion for shells, made of the parsers of all commands."""

import argparse
import importlib
from collections.abc import Mapping
from dataclasses import Field
from pathlib import Path
from typing import Any

import shtab

from swarm_mj.cli import COMMANDS
from swarm_mj.cli.options import declare
from swarm_mj.cli.overview import overview_parser
from swarm_mj.system.fields import kind_of

# Names that a folder may stand for: zsh and bash each have their way to offer both.
OR_FOLDER = {
    "bash": '{function}() {{ compgen -W \'{names}\' -- "$1"; compgen -d -- "$1"; }}',
    "zsh": "{function}() {{ compadd {names}; _files -/ }}",
}


# Files of one kind, and folders on the way to them.
OF_KIND = {
    "bash": '{function}() {{ compgen -f -X \'!*{names}\' -- "$1"; compgen -d -- "$1"; }}',
    "zsh": "{function}() {{ _files -g '*{names}' }}",
}


def completion(shell: str) -> str:
    """Return a script that completes commands, options, choices, policies and files in a shell."""
    parser = overview_parser()
    commands = parser.add_subparsers()
    for name, summary in COMMANDS.items():
        command = commands.add_parser(name, help=summary)
        declare(command, importlib.import_module(f"swarm_mj.cli.{name}").Options)
        for action in command._actions:
            _complete(action, f"_swarm_mj_{name}_{action.dest}")
    return shtab.complete(parser, shell)


def _complete(action: argparse.Action, function: str) -> None:
    """Tells shtab what may follow a flag, by the field that it was made of.

    A shell function of that name offers what shtab has no words for.
    """
    spec: Field[Any] | None = getattr(action, "spec", None)
    if spec is None:
        return
    if "choices" in spec.metadata:
        action.choices = spec.metadata["choices"]
    elif "offers" in spec.metadata:
        _mark_function(action, function, OR_FOLDER, " ".join(spec.metadata["offers"]))
    elif "ending" in spec.metadata:
        _mark_function(action, function, OF_KIND, spec.metadata["ending"])
    elif kind_of(spec) is Path:
        _mark(action, shtab.FILE)


def _mark_function(
    action: argparse.Action, function: str, texts: Mapping[str, str], names: str
) -> None:
    """Has a shell function of this name and text offer these."""
    filled = {shell: text.format(function=function, names=names) for shell, text in texts.items()}
    _mark(action, {**dict.fromkeys(texts, function), "preamble": filled})


def _mark(action: argparse.Action, how: object) -> None:
    vars(action)["complete"] = how  # where shtab reads it
