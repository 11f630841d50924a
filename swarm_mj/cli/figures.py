"""`swarm-mj figures`: draws the paper's figures from result files."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.status import Status as StatusLine

from swarm_mj.evaluation.figures import quiet_matplotlib
from swarm_mj.evaluation.published import FIGURES, FLOCK, FORMATS, RESULT_FIGURES
from swarm_mj.evaluation.results import Result
from swarm_mj.evaluation.results_files import read_results
from swarm_mj.policies.registry import files_of
from swarm_mj.system.arguments import check_choice
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import GONE_IN, files_read, setting, the_file
from swarm_mj.system.terminal import plain_console
from swarm_mj.system.writing import Output, check_outputs

if TYPE_CHECKING:  # matplotlib is slow to import
    from swarm_mj.evaluation.figures.style import Figure

FLOCKS = f"the mission flown for {FLOCK}"  # a heading of the help


@dataclass(frozen=True, kw_only=True)
class FiguresOptions:
    """The options of `swarm-mj figures`."""

    results: tuple[Path, ...] = setting(
        help="files of one preset that `swarm-mj evaluate --csv` wrote",
        metavar="RESULTS.csv",
        is_positional=True,
        reads=the_file,
    )
    out: Path = setting(help="where to write", metavar="DIR")
    figure: tuple[str, ...] = setting(
        FIGURES, "which to draw", choices=FIGURES, shown="all that have points"
    )
    format: tuple[str, ...] = setting(("svg", "png"), "of the files", choices=FORMATS)
    policy: tuple[str, ...] = setting(
        (),
        "draw these methods only: policies of the results, or a GNN's name among the published",
        metavar="NAME",
        shown="all",
    )
    force: bool = setting(False, "replace existing figures")
    yes: bool = setting(False, f"ignored: drawing needs little memory; removed in {GONE_IN}")
    flock_policy: str = setting(
        "mst", "who talks to whom in it", metavar="POLICY", group=FLOCKS, reads=files_of
    )
    flock_seed: int = setting(1, "its seed", group=FLOCKS)


def run(options: FiguresOptions) -> int:
    """Run the command; return its exit code."""
    paths = _paths(options)
    results: list[Result] = []
    for path in options.results:
        results += read_results(path)
    console = plain_console()
    written: list[str] = []
    with Console(stderr=True).status("Drawing ...") as status:
        quiet_matplotlib()
        drawn = _draw(options, results, status)
        from swarm_mj.evaluation.figures.style import save  # slow to import

        # Once all are drawn, so that a failure writes none.
        for name, figure in drawn.items():
            for path in paths[name]:
                status.update(f"Writing {path.name} ...")
                save(figure, path)
                written.append(str(path))
    console.print(f"Wrote {' '.join(written)}")
    left_out = [name for name in paths if name not in drawn]
    if left_out:
        console.print(f"Left out {', '.join(left_out)}: the results hold no point of them")
    return DONE


def _draw(
    options: FiguresOptions, results: Sequence[Result], status: StatusLine
) -> "dict[str, Figure]":
    """Return the figures in the order asked for, but for those that the results have no point of.

    Raises ValueError for a method that is unknown, results that cannot be compared, or if a figure
    that was asked for by its name has no point.
    """
    from swarm_mj.evaluation.figures.curves import NoPointsError, preset_of  # slow to import
    from swarm_mj.evaluation.figures.drawing import draw
    from swarm_mj.evaluation.figures.flock import draw_flock
    from swarm_mj.evaluation.figures.style import LOOKS

    methods = dict.fromkeys([*LOOKS, *(result.policy for result in results)])
    for method in options.policy:
        check_choice("policy", method, methods)
    drawn: dict[str, Figure] = {}
    # The flock flies a mission, so it comes last: the others are refused before that wait.
    for name in sorted(options.figure, key=lambda name: name == FLOCK):
        status.update(f"Drawing {name} ...")
        try:
            if name == FLOCK:
                preset = preset_of(results)
                drawn[name] = draw_flock(preset, options.flock_policy, options.flock_seed)
            else:
                drawn[name] = draw(RESULT_FIGURES[name], results, options.policy)
        except NoPointsError:
            if options.figure != FIGURES:
                raise
    in_order: dict[str, Figure] = {}
    for name in options.figure:
        if name in drawn:
            in_order[name] = drawn[name]
    return in_order


def _paths(options: FiguresOptions) -> dict[str, list[Path]]:
    """Return the files of each figure; raise ValueError for those that cannot be written."""
    paths: dict[str, list[Path]] = {}
    outputs: list[Output] = []
    for name in options.figure:
        paths[name] = [options.out / f"{name}.{end}" for end in dict.fromkeys(options.format)]
    for of_figure in paths.values():
        outputs += [Output("figure", path) for path in of_figure]
    check_outputs(
        *outputs,
        inputs=files_read(options),
        must_be_new=not options.force,
    )
    return paths
