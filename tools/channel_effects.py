"""The list of channel effects in the docs, made from the classes of `radio.effects`."""

import inspect
import re
from pathlib import Path

from swarm_mj.cli.mission_options import FLAGS
from swarm_mj.evaluation.markdown_table import markdown_table
from swarm_mj.radio.effect import MissionEffect
from swarm_mj.radio.effects import EFFECTS

HEADS = ("effect", "options", "model")


def table(_folder: Path, /) -> str:
    """Return the list as Markdown; no results are in it."""
    rows = [(_name(effect), _options(effect), _model(effect)) for effect in EFFECTS]
    return markdown_table(HEADS, rows)


def _name(effect: type[MissionEffect]) -> str:
    """Return the name of its class in words."""
    return re.sub(r"(?<!^)(?=[A-Z])", " ", effect.__name__).lower()


def _options(effect: type[MissionEffect]) -> str:
    return ", ".join(f"`{FLAGS[name]}`" for name in effect.reads)


def _model(effect: type[MissionEffect]) -> str:
    """Return its docstring in a line."""
    return " ".join((inspect.getdoc(effect) or "").split())
