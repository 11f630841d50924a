"""`swarm-mj figures`: draws the paper's figures from result files."""

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console

from swarm_mj.cli.options import new_parser
from swarm_mj.cli.outputs import check_writable
from swarm_mj.evaluation.figures.contents import FIGURES, FLOCK, FORMATS
from swarm_mj.evaluation.results import read_results


def add_parser(commands: Any) -> None:  # noqa: ANN401 - argparse names no public type
    """Adds the command."""
    parser = new_parser(
        commands,
        "figures",
        "Draw the paper's figures, ours beside the published curves, from result files.",
    )
    parser.add_argument(
        "results",
        type=Path,
        nargs="+",
        metavar="RESULTS.csv",
        help="files of one preset that `swarm-mj evaluate --csv` wrote",
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="where to write")
    _add_several(parser, "--figure", FIGURES, "which to draw", "all")
    _add_several(parser, "--format", FORMATS, "of the files", "svg and png")
    parser.add_argument("--force", action="store_true", help="replace existing figures")
    group = parser.add_argument_group(FLOCK, "The mission that is flown for it.")
    group.add_argument("--flock-policy", default="mst", metavar="POLICY", help="who talks to whom")
    group.add_argument("--flock-seed", type=int, default=1, metavar="SEED", help="the mission's")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Runs the command; returns its exit code."""
    results = [result for path in options.results for result in read_results(path)]
    paths = {name: _paths(options, name) for name in options.figure or FIGURES}
    with Console(stderr=True).status("Drawing ...") as status:
        from swarm_mj.evaluation.figures.gallery import (
            draw_figure,  # matplotlib takes its time to import
        )
        from swarm_mj.evaluation.figures.style import save

        drawn = {}
        for name in paths:
            status.update(f"Drawing {name} ...")
            drawn[name] = draw_figure(
                name,
                results,
                flock_policy=options.flock_policy,
                flock_seed=options.flock_seed,
            )
        for name in paths:
            status.update(f"Writing {name} ...")
            for path in paths[name]:
                save(drawn[name], path)
    console = Console(highlight=False, soft_wrap=True, markup=False)
    console.print(f"Wrote {' '.join(str(path) for name in paths for path in paths[name])}")
    return 0


def _add_several(
    parser: argparse.ArgumentParser, flag: str, choices: tuple[str, ...], what: str, default: str
) -> None:
    """An option of several values, after one flag or several."""
    parser.add_argument(
        flag,
        action="extend",
        nargs="+",
        choices=choices,
        metavar="NAME",
        help=f"{what}: {', '.join(choices)} (default: {default})",
    )


def _paths(options: argparse.Namespace, name: str) -> list[Path]:
    """A figure's files; raises ValueError for those that cannot be written."""
    endings = dict.fromkeys(options.format or ("svg", "png"))
    paths = [options.out / f"{name}.{ending}" for ending in endings]
    for path in paths:
        check_writable(path, "figure", must_be_new=not options.force)
    return paths
