"""Loggers of a user's own, for services that keep training runs, such as W&B, MLflow or Trackio."""

import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from swarm_mj.system.user_code import make


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


class Guarded:
    """A logger whose first failure is its last call, and does not end the run."""

    def __init__(self, logger: Logger | None, complain: Callable[[str], object] | None) -> None:
        """Take the logger, if there is one, and who hears of its failure; None warns."""
        self._logger = logger
        self._complain = complain or warnings.warn

    def start(self, settings: Mapping[str, Any], folder: Path) -> None:
        """Call `Logger.start`."""
        self._do(lambda logger: logger.start(settings, folder))

    def log(self, row: Mapping[str, float], decisions: int) -> None:
        """Call `Logger.log`."""
        self._do(lambda logger: logger.log(row, decisions))

    def finish(self) -> None:
        """Call `Logger.finish`."""
        self._do(lambda logger: logger.finish())

    def _do(self, call: Callable[[Logger], None]) -> None:
        logger = self._logger
        if logger is None:
            return
        try:
            call(logger)
        except (Exception, SystemExit) as error:
            self._logger = None  # what failed once is left alone
            said = " ".join(f"{type(error).__name__}: {error}".split())[:300]
            name = type(logger).__name__
            self._complain(f"The logger {name} failed ({said}); the run goes on without it.")
