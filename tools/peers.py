"""The speed of swarm_mj beside its peers: agent-steps a second on one core, 40 agents.

    make bench-peers                        # installs VMAS in .venv/peers, then measures
    make bench-peers ARGS="--authors DIR"   # with the paper's authors' code, of a clone in DIR

An agent-step is one agent in one step of its environment. Steps differ in what they do, and each
row says what its own has. All arms are measured in one run, one after the other in each of several
rounds, by the processor time of one thread, so that other load on the machine affects all alike.
`peers_arms.py` has the arms. What is not installed here is left out, and a line says how to get it.
"""

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from timeit import timeit

from peers_arms import (
    GET_AUTHORS,
    GET_VMAS,
    NUM_AGENTS,
    Arm,
    authors_arms,
    mujoco_arms,
    own_arms,
    vmas_arms,
)

from swarm_mj.cli import script
from swarm_mj.cli.options import output_option
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import setting
from swarm_mj.system.packages import commit
from swarm_mj.system.terminal import WorkBar, plain_console
from swarm_mj.system.writing import Output, check_outputs, write_csv

ROOT = Path(__file__).resolve().parent.parent
COLUMNS = (
    *("arm", "name", "missions", "agent_steps_per_s", "least", "greatest"),
    *("has", "version", "commit"),
)
LINE_EVERY_S = 10.0  # where no terminal shows the bar
LEAST_S = 1e-7  # of a call, where the clock is too coarse to see it


@dataclass(frozen=True, kw_only=True)
class Options:
    """What is measured, for how long, and where the rows go."""

    rounds: int = setting(11, "how often each arm is measured", low=1, high=1000)
    seconds: float = setting(
        0.5, "a measurement's time, about; at least one step", unit="s", low=0.001, high=60.0
    )
    authors: Path | None = setting(
        None, "folder of a clone of the authors' code", metavar="DIR", shown="left out"
    )
    out: Path = output_option(
        ROOT / "training" / "results" / "peers.csv",
        "where the rows go; an existing file is replaced",
        metavar="FILE.csv",
        shown="training/results/peers.csv",
    )


def arms_of(options: Options, say: Callable[[str], None]) -> list[Arm]:
    """Return the arms that can be measured here; say which are left out, and how to get them."""
    arms = [*own_arms(), *mujoco_arms()]
    try:
        arms += vmas_arms()
    except ModuleNotFoundError as error:
        say(f"VMAS is left out: {error}; {GET_VMAS}")
    if options.authors is None:
        say(f"the authors' environment is left out: {GET_AUTHORS}")
        return arms
    try:
        arms += authors_arms(options.authors)
    except ModuleNotFoundError as error:
        say(f"the authors' environment is left out: {error}; gym comes with VMAS, and {GET_VMAS}")
    return arms


def rates(arms: Sequence[Arm], rounds: int, seconds: float, bar: WorkBar) -> dict[str, list[float]]:
    """Return the agent-steps a second of each arm in each round [1/s], by its key.

    Each is measured once in a round, in turn, by the processor time of this thread.
    """
    numbers = {}
    for each in arms:
        each.step()  # what is compiled or allocated at first does not count
        once_s = max(timeit(each.step, number=1, timer=time.thread_time), LEAST_S)
        numbers[each.arm] = max(1, int(seconds / once_s))
    found: dict[str, list[float]] = {each.arm: [] for each in arms}
    for _ in range(rounds):
        for each in arms:
            bar.text = each.name
            number = numbers[each.arm]
            took_s = timeit(each.step, number=number, timer=time.thread_time)
            agent_steps = number * each.missions * NUM_AGENTS
            found[each.arm].append(agent_steps / max(took_s, LEAST_S))
            bar.advance()
    return found


def rows_of(arms: Sequence[Arm], found: dict[str, list[float]]) -> list[dict[str, object]]:
    """Return a row for each arm: the median of its rounds, the least and the greatest."""
    of_commit = commit()
    rows: list[dict[str, object]] = []
    for each in arms:
        its = found[each.arm]
        rows.append(
            {
                "arm": each.arm,
                "name": each.name,
                "missions": each.missions,
                "agent_steps_per_s": median(its),
                "least": min(its),
                "greatest": max(its),
                "has": each.has,
                "version": each.version,
                "commit": of_commit,
            }
        )
    return rows


def run(options: Options) -> int:
    """Measure all arms, write their rows and print them; return the exit code."""
    check_outputs(Output("--out", options.out, ".csv"))
    console = plain_console(is_error=True)
    console.print("Preparing the environments ...")
    arms = arms_of(options, console.print)
    total = options.rounds * len(arms)
    with WorkBar("Measuring", total, "measurements", line_every_s=LINE_EVERY_S) as bar:
        found = rates(arms, options.rounds, options.seconds, bar)
    rows = rows_of(arms, found)
    write_csv(options.out, COLUMNS, rows)
    for row in rows:
        spread = f"{row['least']:,.0f} to {row['greatest']:,.0f}"
        rate = f"{row['agent_steps_per_s']:,.0f} agent-steps/s ({spread})"
        print(f"{row['name']}, {row['missions']} at once: {rate}")
    print(f"Written to {options.out}")
    return DONE


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the tool; return its exit code."""
    return script(Options, run, arguments)


if __name__ == "__main__":
    sys.exit(main())
