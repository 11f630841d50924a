"""`swarm-mj evaluate`: policies over the same missions, with error bars."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import ClassVar

from rich.console import Console

from swarm_mj.api.flight import Flight, fly_mission
from swarm_mj.api.live import (
    LiveFlight,
    check_live,
    keep_open,
    live_option,
    open_viewer,
    speed_option,
)
from swarm_mj.cli.mission_options import NAMES, OTHERS, PolicyOptions, several_missions
from swarm_mj.cli.options import common_output, output_option
from swarm_mj.evaluation import flying
from swarm_mj.evaluation.batch import BatchCosts
from swarm_mj.evaluation.engines import EngineOptions
from swarm_mj.evaluation.figures import quiet_matplotlib
from swarm_mj.evaluation.results import Result
from swarm_mj.evaluation.study import DEFAULT_POLICIES, Study
from swarm_mj.evaluation.study_needs import study_needs
from swarm_mj.evaluation.summary import study_results, write_evaluated
from swarm_mj.evaluation.table import print_results
from swarm_mj.mission import Mission
from swarm_mj.policies import registry
from swarm_mj.replay.view import LiveViewer
from swarm_mj.system.exit_codes import DONE, FAILED, INTERRUPTED
from swarm_mj.system.fields import common_setting, files_read, same_as
from swarm_mj.system.interrupt import deferred_interrupt
from swarm_mj.system.needs import YES, check_fits, memory_errors
from swarm_mj.system.packages import need
from swarm_mj.system.terminal import say_written, tell_cores
from swarm_mj.system.writing import Output, check_outputs, owned

LINE_EVERY_S = 30.0  # where no bar can be drawn, such as in the log of a cluster's job
COMMIT_UNKNOWN = (
    "The files name no commit: this swarm_mj was built from files without their git repository. "
    "Install it from a clone."
)


@dataclass(frozen=True, kw_only=True)
class StudyFlags(EngineOptions):
    """How a study is flown, and where its results go."""

    EPILOG: ClassVar = (
        "Exit codes: 0 done, 1 the machine failed, 2 bad input, 130 interrupted (with --json, "
        "--csv or --parquet, --resume continues)."
    )
    json: Path | None = common_output(
        None, "write all figures and each mission's costs", metavar="FILE.json"
    )
    csv: Path | None = common_output(
        None, "write all figures, one row per policy and mission type", metavar="FILE.csv"
    )
    parquet: Path | None = output_option(
        None, "write each mission's costs, one row a mission", metavar="FILE.parquet"
    )
    plot: Path | None = common_output(
        None, "draw the policies' ages, the lowest first", metavar="FILE.png|.svg|.pdf"
    )
    wide: bool = common_output(
        False, "print more columns: velocity variance, quantiles, bytes, published values"
    )
    force: bool = output_option(False, "replace existing results and progress")
    yes: bool = output_option(False, YES)
    resume: bool = output_option(False, "continue where an interruption broke off")

    @property
    def files(self) -> list[Path]:
        """The files of the results; beside the first is the progress."""
        return [path for path in (self.json, self.csv, self.parquet) if path]


@dataclass(frozen=True, kw_only=True)
class EvaluateOptions(StudyFlags, PolicyOptions):
    """The options of `swarm-mj evaluate`."""

    policy: tuple[str, ...] = common_setting(
        DEFAULT_POLICIES, f"{NAMES}, all of these, {OTHERS}", reads=registry.files_of
    )
    episodes: int = same_as(Study, "episodes")
    seed: int = same_as(Study, "seed")
    baseline: str | None = same_as(Study, "baseline")
    missions: tuple[Mission, ...] = several_missions()
    live: str | None = live_option(
        help="first show the first policy's first mission while it flies, in rerun's viewer or, "
        "with web, in a browser; it stays open until you close it",
        is_common=False,
    )
    speed: float | None = speed_option()

    @property
    def study(self) -> Study:
        """The study that the options name; raises ValueError as it does."""
        named = registry.listed(self.policy)
        flown = dict(zip(named, registry.with_payload(named, self.payload), strict=True))
        return Study(
            policies=tuple(dict.fromkeys(flown.values())),
            regimes=self.missions,
            episodes=self.episodes,
            seed=self.seed,
            probability=self.probability,
            is_deterministic=self.is_deterministic,
            features=self.features,
            networks=self.networks,
            components=self.components,
            baseline=None if self.baseline is None else flown.get(self.baseline, self.baseline),
        )


def run(options: EvaluateOptions) -> int:
    """Run the command; return its exit code."""
    check_live(options.live, options.speed)
    study = options.study
    if options.live is None:
        return run_study(options, study)
    console = Console(stderr=True, highlight=False)
    with open_viewer(options.live, console) as viewer:
        code = _show_first(options, study, viewer, console)
        if code == DONE:
            code = run_study(options, study)
        return keep_open(viewer) if code == DONE else code


def _show_first(
    options: EvaluateOptions, study: Study, viewer: LiveViewer, console: Console
) -> int:
    """Fly the first policy's first mission, as the study will, and show it; return the code."""
    first = study.batches[0]
    policy = first.policy
    flight = Flight(
        mission=first.mission,
        policy=registry.make_policy_with(first.arguments, policy, first.mission),
        policy_name=policy,
        arguments=first.arguments,
        components=study.components,
        seed=study.seed,
        speed=math.inf if options.speed is None else options.speed,
    )
    live = LiveFlight(viewer, f"{policy}, seed {study.seed}", speed=options.speed)
    flown = fly_mission(flight, console=console, way_on=None, shows=live.begin)
    if flown.ending:
        console.print(f"{flown.ending}.")
    return flown.code


def run_study(options: StudyFlags, study: Study) -> int:
    """Fly a study as asked, and write its results; return the exit code."""
    need("scipy", "an evaluation")
    outputs = [
        Output("--json", options.json, ".json"),
        Output("--csv", options.csv, ".csv"),
        Output("--parquet", options.parquet, ".parquet"),
    ]
    chart = Output("--plot", options.plot, ".png|.svg|.pdf")
    if options.plot:
        need("matplotlib", "a chart")
    if options.parquet:
        for module in ("pandas", "pyarrow"):
            need(module, "--parquet", "write --json, which has each mission's costs, too")
    # A study that is a file names more of them than the options.
    inputs = [*files_read(options), *files_read(study)]
    check_outputs(*outputs, chart, inputs=inputs, must_be_new=not options.force)
    way_out = "choose fewer --jobs, --robots, --windows or --episodes"
    needs = study_needs(study, options.jobs_here)
    check_fits(needs, next(iter(options.files), None), way_out, is_forced=options.yes)
    with ExitStack() as stack:
        for path in options.files:
            stack.enter_context(owned(path))
        return _evaluate(options, study, _progress_file(options, outputs))


def _evaluate(options: StudyFlags, study: Study, kept: Path | None) -> int:
    """Fly the rest of a study, and write its results; `kept` is the progress file."""
    engine = options.engine_for(study)
    tell_cores(options.jobs_here)
    console = Console(stderr=True, highlight=False)
    for note in _notes_on(study):
        console.print(note)
    header = study.header()
    costs = _begun(kept, header, is_resumed=options.resume) if kept else {}
    try:
        keep = partial(flying.append_progress, kept, header) if kept else None
        with _kept_if_flown(kept, study, costs, console), memory_errors():
            flying.fly_study(study, costs, engine, keep, console, line_every_s=LINE_EVERY_S)
    except (KeyboardInterrupt, MemoryError) as error:
        is_memory = isinstance(error, MemoryError)
        ending = "Out of memory" if is_memory else "Interrupted"
        hint = _way_on(kept, costs)
        console.print(f"{ending} {_how_far(study, costs)}; {hint}.")
        return FAILED if is_memory else INTERRUPTED
    with deferred_interrupt():
        evaluated = study_results(study, costs, header)
        for path in options.files:
            write_evaluated(path, evaluated)
        if kept:
            kept.unlink()
    results = [each.result for each in evaluated]
    print_results(results, is_wide=options.wide)
    _say_written(options, results)
    if options.files and not header["commit"]:
        console.print(COMMIT_UNKNOWN, soft_wrap=True)
    return DONE


def _notes_on(study: Study) -> list[str]:
    """Return what is to be said of policies that fly otherwise than by their names, each once."""
    notes: dict[str, None] = {}
    for regime, policy in product(study.regimes, study.policies):
        notes[registry.note_on(policy, regime)] = None
    return [note for note in notes if note]


def _say_written(options: StudyFlags, results: Sequence[Result]) -> None:
    """Name the files of the results, and draw and name the chart."""
    for path in options.files:
        say_written(path)
    if options.plot:
        _write_chart(options.plot, results)


def _way_on(kept: Path | None, costs: Mapping[int, BatchCosts]) -> str:
    """Return what became of the missions of a study that was broken off, and how to go on."""
    if not costs:
        return "none was flown to its end yet, so nothing is kept"
    return "the same command with --resume continues" if kept else "nothing was kept"


def _how_far(study: Study, costs: Mapping[int, BatchCosts]) -> str:
    return f"after {flying.num_flown(study, costs)} of {study.num_missions} missions"


@contextmanager
def _kept_if_flown(
    kept: Path | None, study: Study, costs: Mapping[int, BatchCosts], console: Console
) -> Iterator[None]:
    """Say after an error how to go on; remove the progress file if it has no missions.

    Such a file would only make the next command ask for `--force`. The caller has the words for
    an interruption, and for memory that does not suffice.
    """
    try:
        yield
    except (Exception, KeyboardInterrupt) as error:
        if kept and not costs:
            kept.unlink(missing_ok=True)
        elif kept and not isinstance(error, (MemoryError, KeyboardInterrupt)):
            console.print(
                f"Failed {_how_far(study, costs)}; the same command with --resume continues. If "
                "the study's own code must change first, start over with --force: missions of "
                "changed code are not mixed with those flown.",
                soft_wrap=True,
            )
        raise


def _begun(kept: Path, header: Mapping[str, object], *, is_resumed: bool) -> dict[int, BatchCosts]:
    """Return what the progress file has of the study; begin the file unless it is resumed."""
    if is_resumed and kept.exists():
        return flying.resume_progress(kept, header)
    flying.start_progress(kept, header)
    return {}


def _write_chart(path: Path, results: Sequence[Result]) -> None:
    quiet_matplotlib()
    from swarm_mj.api.charts import draw_evaluation  # matplotlib is slow to import
    from swarm_mj.evaluation.figures.style import save

    save(draw_evaluation(results), path)
    say_written(path)


def _progress_file(options: StudyFlags, outputs: Iterable[Output]) -> Path | None:
    """Return the progress file, or None without outputs; raise ValueError if it is in the way."""
    if not options.files:
        if options.resume:
            raise ValueError("--resume needs the --json or --csv, or --parquet, that it continues")
        return None
    kept = flying.progress_path(options.files[0])
    check_outputs(Output("progress", kept), *outputs)  # also against a link to the progress
    if kept.exists() and not (options.resume or options.force):
        ways = "continue it with --resume, or start over with --force"
        raise ValueError(f"progress {kept} of a run that failed or was stopped exists; {ways}")
    return kept
