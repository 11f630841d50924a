"""`swarm-mj check`: flies missions until it is certain whether enough of them converge in time."""

from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

from rich.console import Console

from swarm_mj.cli.mission_options import (
    NAMES,
    OTHERS,
    PolicyOptions,
    mission_given,
    mission_options,
)
from swarm_mj.cli.options import common_output, nested, output_option
from swarm_mj.evaluation.convergence import Convergence, Goal, Verdict, converging
from swarm_mj.evaluation.engines import PROCESSES, EngineOptions
from swarm_mj.evaluation.figures import quiet_matplotlib
from swarm_mj.evaluation.study import Study
from swarm_mj.evaluation.study_needs import study_needs
from swarm_mj.mission import Mission
from swarm_mj.policies import registry
from swarm_mj.system.exit_codes import DONE, FAILED, INTERRUPTED, REFUTED, UNDECIDED
from swarm_mj.system.fields import common_setting, files_read, same_as, setting
from swarm_mj.system.interrupt import deferred_interrupt
from swarm_mj.system.needs import YES, check_fits, memory_errors
from swarm_mj.system.packages import need
from swarm_mj.system.terminal import WorkBar, num_cores, plain_console, say_written
from swarm_mj.system.writing import Output, check_outputs, write_json

MOST_JOBS = 8  # unless asked for: a process takes 0.3 GB, and seconds to start
CODES: dict[Verdict, int] = {"holds": DONE, "does not hold": REFUTED, "not decided": UNDECIDED}


@dataclass(frozen=True, kw_only=True)
class CheckOptions(EngineOptions, PolicyOptions):
    """The options of `swarm-mj check`."""

    EPILOG: ClassVar = (
        "Exit codes: 0 the claim holds, 1 the machine failed, 2 bad input, 3 it does not hold, "
        "4 not decided by --episodes missions, 130 interrupted."
    )
    policy: str = common_setting("planner", f"{NAMES}, or {OTHERS}", reads=registry.files_of)
    within_s: float = same_as(Goal, "within_s")
    share: float = same_as(Goal, "share")
    below: float | None = same_as(Goal, "below")
    unit: str | None = same_as(Goal, "unit")
    level: float = same_as(Goal, "level")
    episodes: int = common_setting(
        1000, "missions at most; fewer where the answer is certain before", low=1, high=10**5
    )
    seed: int = same_as(Study, "seed")
    jobs: int = setting(
        min(num_cores(), MOST_JOBS),
        "how many at once",
        low=1,
        high=256,
        shown=f"one a core, {MOST_JOBS} at most",
        is_common=True,
        group=PROCESSES,
    )
    json: Path | None = common_output(None, "write the verdict and each mission's numbers")
    plot: Path | None = common_output(
        None, "draw by when missions converged", metavar="FILE.png|.svg|.pdf"
    )
    force: bool = output_option(False, "replace existing files")
    yes: bool = output_option(False, YES)
    mission: Mission = nested(partial(mission_options, is_task_bare=True), mission_given)

    @property
    def goal(self) -> Goal:
        """The claim; raises ValueError as it does."""
        return Goal(
            within_s=self.within_s,
            share=self.share,
            below=self.below,
            unit=self.unit,
            level=self.level,
        )

    @property
    def study(self) -> Study:
        """The missions; raises ValueError as a study does."""
        return Study(
            policies=tuple(registry.with_payload([self.policy], self.payload)),
            regimes=(self.mission,),
            episodes=self.episodes,
            seed=self.seed,
            probability=self.probability,
            is_deterministic=self.is_deterministic,
            features=self.features,
            networks=self.networks,
            components=self.components,
        )


def run(options: CheckOptions) -> int:
    """Run the command; return its exit code."""
    need("scipy", "a check")
    if options.plot:
        need("matplotlib", "a chart")
    check_outputs(
        Output("--json", options.json, ".json"),
        Output("--plot", options.plot, ".png|.svg|.pdf"),
        inputs=files_read(options),
        must_be_new=not options.force,
    )
    goal = options.goal
    study = options.study
    needs = study_needs(study, options.jobs_here)
    way_out = "choose fewer --jobs, --robots, --windows or --episodes"
    check_fits(needs, None, way_out, is_forced=options.yes)
    console = Console(stderr=True, highlight=False)
    bar = WorkBar("Flying", options.episodes, "missions at most", console=console)
    found: Convergence | None = None
    ending = ""
    code = DONE
    try:
        flown = converging(study, goal, options.engine_for(study))
        with memory_errors(), bar, closing(flown):
            for found in flown:
                bar.move_to(found.num_missions)
                bar.text = _so_far(found)
    except KeyboardInterrupt:
        code = INTERRUPTED
        ending = "Interrupted"
    except MemoryError:
        code = FAILED
        ending = "Out of memory"
    if found is None:
        console.print(f"{ending} before the first missions were done.")
        return code
    _say_note(study, options.mission, console)
    _report(options, found)
    if ending:
        console.print(f"{ending} after {found.num_missions} missions; these are shown.")
        return code
    if found.verdict == "not decided":
        console.print("More missions (--episodes) may decide, or claim another --share.")
    return CODES[found.verdict]


def _report(options: CheckOptions, found: Convergence) -> None:
    """Print what was found, and write it where it was asked for."""
    with deferred_interrupt():
        plain_console().print(repr(found))
        if options.json:
            write_json(options.json, found.report())
            say_written(options.json)
        if options.plot:
            _write_chart(options.plot, found)


def _say_note(study: Study, mission: Mission, console: Console) -> None:
    """Say how the policy flies these missions, if not as itself."""
    (asked,) = study.policies
    note = registry.note_on(asked, mission)
    if note:
        console.print(note)


def _so_far(found: Convergence) -> str:
    low, high = found.interval
    return f"{low:.0%} to {high:.0%} converge in time"


def _write_chart(path: Path, found: Convergence) -> None:
    quiet_matplotlib()
    from swarm_mj.evaluation.figures.style import save  # matplotlib is slow to import

    save(found.plot(), path)
    say_written(path)
