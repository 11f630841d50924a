"""The leaderboard: what every policy reaches on the benchmark, beside what it knows.

    python tools/leaderboard.py    # make leaderboard: flies it if it was not yet, and writes it

Missions are flown as `swarm-mj study run benchmark` flies them. An interrupted run continues.
"""

import math
import os
import sys
import tomllib
from dataclasses import asdict
from pathlib import Path
from typing import Any

from results_rows import Row, Rows, origin, read, select

from swarm_mj.api.policy_facts import facts_of
from swarm_mj.cli import main as swarm_mj
from swarm_mj.cli.study import read_study
from swarm_mj.evaluation.markdown_table import markdown_table
from swarm_mj.mission import Mission, paper
from swarm_mj.policies.about import NO_PAYLOAD, Information
from swarm_mj.policies.registry import POLICIES, flown_name, make_policy
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.packages import asset
from swarm_mj.system.writing import write_text

ROOT = Path(__file__).resolve().parent.parent
STUDY = "benchmark"
AGAIN = "`make leaderboard`, without that file,"
TEXT = """\
# Leaderboard

Every policy on the twelve kinds of missions of the benchmark, `assets/studies/benchmark.toml`, 100
missions each. No seed of them chose anything. [Studies](../docs/studies.md#the-benchmark) says how
a policy of yours enters.

A cell is the mean age of information over the missions and, in brackets, the age that 5 % of them
exceed [windows]; then, where fewer than 99 % of the missions are complete (every robot has heard of
every other one), the share that is. The third column is the geometric mean over the twelve of how
many times the age of `tdma` the mean age is: lower is better. Compare policies within one kind of
information: robots that sense the channel before they speak know more than those that only hear T,
M and P, larger packets carry more, and a centre knows the truth.

"""
BASELINE = "tdma"
SHARE = 0.99  # of missions complete; where a policy has fewer, its cell says so

# What is beside a policy, from the least on. Policies are compared within one of these.
HEARS = "T, M, P"
SENSES = "T, M, P; senses"
CARRIES = "larger packets"
CENTRE = "a centre with the truth"
OWN = "see its code"


def table(folder: Path, /) -> str:
    """Return the leaderboard as Markdown, the lowest score first, with the origin of its numbers.

    Raises ValueError if a policy lacks a kind of mission.
    """
    rows = read([STUDY], folder)
    kinds = kinds_of_missions()
    by_policy = {name: cells_of(name, rows, kinds) for name in dict.fromkeys(_names(rows))}
    baseline = by_policy[BASELINE]
    scores = {name: score(cells, baseline) for name, cells in by_policy.items()}
    heads = ("policy", "information", f"age against `{BASELINE}`", *(f"`{kind}`" for kind in kinds))
    lines: list[tuple[str, ...]] = []
    for name in sorted(scores, key=lambda name: scores[name]):
        ages = [_age(each) for each in by_policy[name]]
        lines.append((f"`{name}`", information_of(name), f"{scores[name]:.2f}", *ages))
    return f"{markdown_table(heads, lines, right_from=2)}\n\n{origin(rows, again=AGAIN)}"


def kinds_of_missions() -> dict[str, Mission]:
    """Return the benchmark's kinds of missions by their names in its file."""
    tables = tomllib.loads((asset("studies") / f"{STUDY}.toml").read_text("utf-8"))
    return dict(zip(tables["missions"], read_study(STUDY).regimes, strict=True))


def cells_of(policy: str, rows: Rows, kinds: dict[str, Mission]) -> Rows:
    """Return a policy's results, one of each kind."""
    found: Rows = []
    for kind, mission in kinds.items():
        its = select(rows, {"policy": flown_name(policy, mission), **asdict(mission)})
        if len(its) != 1:
            raise ValueError(f"{policy} has {len(its)} results of {kind}; fly study {STUDY} anew")
        found += its
    return found


def check_all_flew(folder: Path) -> None:
    """Raise ValueError if results lack a policy: one that was added since they were flown."""
    missing = sorted(set(read_study(STUDY).policies) - set(_names(read([STUDY], folder))))
    if missing:
        raise ValueError(
            f"{folder / STUDY}.csv lacks {', '.join(missing)}; remove it to fly all, or add what "
            f"`swarm-mj study run {STUDY} --policy {missing[0]}` writes by --csv"
        )


def score(cells: Rows, baseline: Rows) -> float:
    """Return the geometric mean over all kinds of how many times the baseline's age an age is."""
    logs = [
        math.log(own["aoi_mean"] / other["aoi_mean"])
        for own, other in zip(cells, baseline, strict=True)
    ]
    return math.exp(sum(logs) / len(logs))


def information_of(policy: str) -> str:
    """Return what a policy's robots have to decide by, in a few words."""
    if policy not in POLICIES:
        return OWN  # to ask it would be to run its code
    mission = paper("random-walk")
    facts: dict[str, Any] = facts_of(policy, make_policy(policy, mission), mission)
    if facts["is_centralised"]:
        return CENTRE
    if facts["payload"] != NO_PAYLOAD:
        return CARRIES
    return SENSES if Information.CARRIER_SENSING.label in (facts["beyond_paper"] or ()) else HEARS


def _names(rows: Rows) -> list[str]:
    return [row["policy"] for row in rows]


def _age(row: Row) -> str:
    age = f"{row['aoi_mean']:.1f} ({row['aoi_p95']:.0f})"
    share = row["complete_share"]
    return age if share >= SHARE else f"{age}, {share:.0%}"


def main() -> int:
    """Fly the rest of the benchmark, and write the leaderboard; return the exit code."""
    folder = ROOT / "training" / "results"
    flown = folder / f"{STUDY}.csv"
    code = DONE
    if not flown.exists():
        parquet = folder / f"{STUDY}.parquet"
        jobs = os.cpu_count() or 1
        command = ("study", "run", STUDY, "--csv", flown, "--parquet", parquet, "--jobs", jobs)
        code = swarm_mj([*map(str, command), "--resume"])
    if code == DONE:
        check_all_flew(folder)
        write_text(ROOT / "training" / "leaderboard.md", f"{TEXT}{table(folder)}\n")
    return code


if __name__ == "__main__":
    sys.exit(main())
