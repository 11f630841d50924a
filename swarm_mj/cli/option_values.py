"""How values typed on a command line are read, where their type alone does not say."""

import argparse
from collections.abc import Callable
from dataclasses import Field
from functools import partial
from pathlib import Path
from typing import Any

from swarm_mj.system.fields import kind_of, meaning_of, numbers_of

BIT_RATES = {"k": 1e3, "m": 1e6, "g": 1e9}  # the factor of a letter behind a number


def _path(text: str) -> Path:
    """Return a path; an empty name would be the current folder."""
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


def reader_of(spec: Field[Any]) -> Callable[[str], object]:
    """Return the function that reads an option's value, by its unit or its kind."""
    kind: Any = kind_of(spec)
    unit = meaning_of(spec).unit
    if unit in CONVERT:
        return CONVERT[unit]
    if kind in (int, float):
        return partial(_number, spec, kind)
    convert: Any = CONVERT.get(kind, kind)
    return convert


def _number(spec: Field[Any], kind: type[int] | type[float], text: str) -> float:
    """Return a number; the refusal of a text says which ones are allowed."""
    try:
        return kind(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"name {numbers_of(spec)}, not {text!r}") from None


# Functions that read a value, by its type or unit; other types read it themselves.
CONVERT: dict[Any, Callable[[str], Any]] = {Path: _path, "bit/s": _bit_rate}
