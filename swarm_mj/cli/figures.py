"""`swarm-mj figures`: draws the paper's figures from result files."""

from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from swarm_mj.evaluation.figures import quiet_matplotlib
from swarm_mj.evaluation.published import FIGURES, FLOCK, FORMATS, RESULT_FIGURES
from swarm_mj.evaluation.results import read_results
from swarm_mj.policies.registry import stored_policies
from swarm_mj.system.fields import GONE_IN, check_choice, setting
from swarm_mj.system.terminal import plain_console
from swarm_mj.system.writing import Output, check_outputs

FLOCKS = f"the mission flown for {FLOCK}"  # a heading of the help


@dataclass(frozen=True, kw_only=True)
class FiguresOptions:
    """The options of `swarm-mj figures`."""

    results: tuple[Path, ...] = setting(
        help="files of one preset that `swarm-mj evaluate --csv` wrote",
        metavar="RESULTS.csv",
        is_positional=True,
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
    flock_policy: str = setting("mst", "who talks to whom in it", metavar="POLICY", group=FLOCKS)
    flock_seed: int = setting(1, "its seed", group=FLOCKS)


def run(options: FiguresOptions) -> int:
    """Run the command; return its exit code."""
    paths = _paths(options)
    results = [result for path in options.results for result in read_results(path)]
    console = plain_console()
    with Console(stderr=True).status("Drawing ...") as status:
        quiet_matplotlib()
        from swarm_mj.evaluation.figures.curves import NoPointsError, preset_of  # slow to import
        from swarm_mj.evaluation.figures.drawing import draw
        from swarm_mj.evaluation.figures.flock import draw_flock
        from swarm_mj.evaluation.figures.style import LOOKS, save

        methods = dict.fromkeys([*LOOKS, *(result.policy for result in results)])
        for method in options.policy:
            check_choice("policy", method, methods)
        policy, seed = options.flock_policy, options.flock_seed
        drawn = {}
        for name in sorted(paths, key=FLOCK.__eq__):  # it flies, and what is refused comes first
            status.update(f"Drawing {name} ...")
            try:
                if name == FLOCK:
                    drawn[name] = draw_flock(preset_of(results), policy, seed)
                else:
                    drawn[name] = draw(RESULT_FIGURES[name], results, options.policy)
            except NoPointsError:
                if options.figure != FIGURES:
                    raise
        written = [(drawn[name], path) for name in paths if name in drawn for path in paths[name]]
        for figure, path in written:  # once all are drawn, so that a failure writes none
            status.update(f"Writing {path.name} ...")
            save(figure, path)
    console.print(f"Wrote {' '.join(str(path) for _, path in written)}")
    if left_out := ", ".join(name for name in paths if name not in drawn):
        console.print(f"Left out {left_out}: the results hold no point of them")
    return 0


def _paths(options: FiguresOptions) -> dict[str, list[Path]]:
    """Return the files of each figure; raise ValueError for those that cannot be written."""
    endings = dict.fromkeys(options.format)
    paths = {name: [options.out / f"{name}.{end}" for end in endings] for name in options.figure}
    check_outputs(
        *(Output("figure", path) for own in paths.values() for path in own),
        inputs=(*options.results, *stored_policies([options.flock_policy])),
        must_be_new=not options.force,
    )
    return paths
