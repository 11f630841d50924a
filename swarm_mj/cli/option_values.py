"""How values typed on a command line are read, where their type alone does not say."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

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


# Functions that read a value, by its type or unit; other types read it themselves.
CONVERT: dict[Any, Callable[[str], Any]] = {Path: _path, "bit/s": _bit_rate}
