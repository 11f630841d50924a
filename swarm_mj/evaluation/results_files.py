"""Files of results: a CSV file has a row for each result, and a column for each field of it."""

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path

import msgspec

from swarm_mj.evaluation.results import COLUMNS, Result
from swarm_mj.mission.specification import Mission
from swarm_mj.system.fields import former_names
from swarm_mj.system.reading import read_rows
from swarm_mj.system.writing import write_csv

MAX_BYTES = 100_000_000  # of a file


def read_results(path: Path) -> list[Result]:
    """Return the rows of a file that `swarm-mj evaluate --csv` wrote, one or more, in its order.

    Columns that no result has are ignored, and those that are newer than the file may be missing.

    Args:
        path: The CSV file.

    Returns:
        The results, one for each row; an empty cell is None.

    Raises:
        ValueError: The file cannot be read as such, or has no rows.

    Example:
        >>> [result.aoi_mean for result in read_results(Path("results.csv"))]  # [windows]
    """
    try:
        rows = read_rows(path, "results file", MAX_BYTES)
        if not rows:
            raise ValueError(f"results file {path} has no rows")
        return [_result(f"results file {path}, line {line}", row) for line, row in rows]
    except ValueError as error:
        raise ValueError(f"{error}; make them with `swarm-mj evaluate --csv FILE`") from error


def write_results(path: Path, results: Iterable[Result]) -> None:
    """Write results as the rows of a CSV file, replaced if it exists; None is an empty cell.

    Args:
        path: The CSV file.
        results: The rows, in the order in which they are written.

    Raises:
        OSError: The file cannot be written.
    """
    write_csv(path, COLUMNS, (asdict(result) for result in results))


def _result(place: str, row: dict[str, str]) -> Result:
    present = former_names(Mission)
    cells = {present.get(name, name): cell or None for name, cell in row.items()}
    try:
        return msgspec.convert(cells, Result, strict=False)
    except msgspec.ValidationError as error:
        raise ValueError(f"{place}: {error}") from error
