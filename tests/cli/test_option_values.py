"""Values that are read by more than their type."""

import argparse
from pathlib import Path

import pytest

from swarm_mj.cli.option_values import CONVERT


@pytest.mark.parametrize(
    ("text", "rate"),
    [("250000", 250e3), ("250k", 250e3), ("6M", 6e6), ("1g", 1e9), ("None", None)],
)
def test_bit_rates_are_read_with_a_letter_or_without(text, rate):
    assert CONVERT["bit/s"](text) == rate


@pytest.mark.parametrize("text", ["fast", "6 Mbit", "", "k"])
def test_what_is_no_bit_rate_is_refused(text):
    with pytest.raises(argparse.ArgumentTypeError, match="name bits per second"):
        CONVERT["bit/s"](text)


def test_an_empty_path_is_not_the_current_folder():
    assert CONVERT[Path]("runs/a") == Path("runs/a")
    with pytest.raises(argparse.ArgumentTypeError, match="name a file or a folder, not ''"):
        CONVERT[Path]("")
