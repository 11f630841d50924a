"""Loggers of a user's own, for services that keep training runs, such as W&B, MLflow or Trackio."""

import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

from swarm_mj.system.user_code import make

Helper = TypeVar("Helper")


@runtime_checkable
class Logger(Protocol):
    """Takes what a run learns to wherever it is kept; `--logger module:Name` makes one."""

    def start(self, settings: Mapping[str, Any], folder: Path) -> None:
        """Begin, or go on with a run that was resumed.

        Args:
            settings: All settings of the run, as in its `settings.json`.
            folder: The run's folder, whose name may be the run's.
        """

    def log(self, row: Mapping[str, float], decisions: int) -> None:
        """Take an evaluation.

        Args:
            row: The learning curve's row, by the names of its columns.
            decisions: Team decisions before it.
        """

    def finish(self) -> None:
        """End: the run is over, or interrupted."""


def make_logger(name: str, folder: Path) -> Logger:
    """Return a user's own logger.

    Args:
        name: `module:Name` of a class, or of a function that makes one; the current folder is
            searched first.
        folder: The run's, for what asks for an argument.

    Raises:
        ValueError: It cannot be loaded, or is no logger.
    """
    logger = make("logger", name, folder)
    if not isinstance(logger, Logger):
        raise ValueError(
            f"logger {name} must have start, log and finish, as {logger!r:.80} has not"
        )
    return logger


class Guarded(Generic[Helper]):
    """A helper that a run can do without: its first failure is its last call, and ends no run."""

    def __init__(
        self, helper: Helper | None, what: str, complain: Callable[[str], object] | None
    ) -> None:
        """Take a helper, if there is one.

        Args:
            helper: It does what a run asks of it, and may fail.
            what: It, in words.
            complain: It hears of a failure; None warns.
        """
        self._helper = helper
        self._what = what
        self._complain = complain or warnings.warn

    @property
    def is_there(self) -> bool:
        """True if there is one, and it has not failed."""
        return self._helper is not None

    def do(self, call: Callable[[Helper], object]) -> None:
        """Make a call of the helper, if it is there."""
        helper = self._helper
        if helper is None:
            return
        try:
            call(helper)
        except (Exception, SystemExit) as error:
            self._helper = None  # what failed once is left alone
            said = " ".join(f"{type(error).__name__}: {error}".split())[:300]
            self._complain(f"The {self._what} failed ({said}); the run goes on without it.")
