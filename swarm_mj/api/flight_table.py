"""The numbers of one flight: for the terminal and for `--json`."""

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from rich.table import Table

from swarm_mj.control.motion import Flocking
from swarm_mj.mission import Mission
from swarm_mj.mission.presets import where_flown
from swarm_mj.mission.robot_failures import num_failures
from swarm_mj.mission.specification import NOTHING
from swarm_mj.policies.policy import CentralisedPolicy, Policy
from swarm_mj.protocol.packets import BITS_PER_BYTE, bits_per_second
from swarm_mj.simulation.rollout import Summary
from swarm_mj.system.terminal import named_values

AGREED = 0.01  # of the first window's velocity variance: a flock with less has agreed
AGE = "age of information: how old a robot's news of another is, over all pairs; less is better"


def flight_numbers(mission: Mission, policy: Policy, summary: Summary) -> dict[str, Any]:
    """The summary of the one mission flown, and what flew it; what does not exist is None."""
    numbers: dict[str, Any] = {"num_windows": summary.num_windows}
    for name, value in asdict(summary).items():
        if value is None or isinstance(value, str):
            numbers[name] = value
        elif name != "num_windows":
            is_count = name.startswith("packets_") or name == "complete_window"
            number = float(value[0])
            numbers[name] = None if math.isnan(number) else int(number) if is_count else number
    first, last = numbers["velocity_variance_first"], numbers["velocity_variance_last"]
    packet_bytes = policy.packet(mission).num_bytes
    flown_s = numbers["num_windows"] * mission.window_s
    return numbers | {
        "packet_bytes": packet_bytes,
        "bytes_per_second": packet_bytes * numbers["packets_transmitted"] / flown_s,
        "velocity_variance_left": last / first if first > 0.0 else None,
        "payload": policy.payload,
        "is_centralised": isinstance(policy, CentralisedPolicy),
    }


def flight_title(mission: Mission, policy: str, seed: int) -> str:
    """What was flown, in a line."""
    team = f"{mission.num_robots} robots" + (" that collide" if mission.collide else "")
    if mission.failure_fraction:
        team += f", {mission.failure_fraction:.0%} of them off half-way"
    known = [f"known {mission.prior_knowledge}"] if mission.prior_knowledge != NOTHING else []
    rate = [] if mission.bit_rate is None else [bits_per_second(mission.bit_rate)]
    flown = (mission.task, policy, team, f"seed {seed}")
    return ", ".join((*flown, *where_flown(mission), *known, *rate))


def flight_table(title: str, mission: Mission, numbers: dict[str, Any], wall_s: float) -> Table:
    """What a flight cost, by its `flight_numbers`, and took here [s]: at most 16 rows."""
    return named_values(title, flight_rows(mission, numbers, wall_s), caption=AGE)


def flight_rows(mission: Mission, numbers: Mapping[str, Any], wall_s: float) -> dict[str, str]:
    """Return the rows of `flight_table`: names and values, as they are shown."""
    decider = "a centre that is told where all are"
    hops, num_off = numbers["hops_mean"], num_failures(mission)
    rows = {
        f"windows of {mission.window_s:g} s flown": f"{numbers['num_windows']} in {wall_s:.2f} s",
        "age of information, mean": _windows(numbers["aoi_mean"], mission, 2),
        "everyone had heard of everyone": _windows(numbers["complete_window"], mission, 0, "after"),
        "radio hops that news travelled, mean": f"{hops:.2f}" if hops else "-",
        **_packets(numbers),
        "packets carry": _payload(numbers["payload"]),
        "  bytes each; sent by the team": _sizes(numbers),
        "who decides": decider if numbers["is_centralised"] else "each robot by itself",
        **_task_costs(mission, numbers),
    }
    if num_off:
        rows["robots switched off half-way"] = f"{num_off}; not counted from then on"
    return rows


def _windows(value: float | int | None, mission: Mission, digits: int, word: str = "") -> str:
    """Return a time in windows and in seconds, or that it never came."""
    if value is None:
        return "never"
    number = f"{value:.{digits}f}"
    windows = "window" if number == "1" else "windows"
    return f"{word} {number} {windows} ({value * mission.window_s:.2g} s)".strip()


def _packets(numbers: Mapping[str, Any]) -> dict[str, str]:
    """What became of them: broadcasts are heard or not, addressed packets delivered or lost."""
    sent, per_window = numbers["packets_sent"], numbers["packets_sent"] / numbers["num_windows"]
    total = f"{sent} ({per_window:.1f} a window)"
    if numbers["packets_attempted"] is None:
        hearers = numbers["hearers_per_packet"]
        return {
            "packets broadcast": total,
            "  heard by at least one robot": _share(numbers["packets_heard"], sent),
            "  robots that heard a packet, mean": "-" if hearers is None else f"{hearers:.2f}",
        }
    return {
        "packets sent, each to one robot": total,
        "  delivered": _share(numbers["packets_delivered"], sent),
        "  lost": _share(numbers["packets_lost"], sent),
        "  answered, and the answer heard": _share(numbers["packets_answered"], sent),
        "  overheard by other robots": f"{numbers['packets_overheard']} times",
    }


def _share(count: int, of: int) -> str:
    return f"{count} ({count / of:.0%})" if of else f"{count}"


def _payload(payload: str) -> str:
    """What packets carry: the buffer is all that a robot knows, T, M and P (II-B)."""
    buffer = "the sender's buffer"
    return buffer if payload == "none" else f"{buffer} and {payload}"


def _sizes(numbers: Mapping[str, Any]) -> str:
    """What a packet weighs, and all of them in a second."""
    rate = bits_per_second(BITS_PER_BYTE * numbers["bytes_per_second"])
    return f"{numbers['packet_bytes']:,}; {rate}"


def _task_costs(mission: Mission, numbers: Mapping[str, Any]) -> dict[str, str]:
    """What the task cost; of the paper's moving teams, the velocity variance."""
    name, unit = numbers["task_cost_name"], numbers["task_cost_unit"]
    if name in (None, Flocking.cost_name):
        return {} if mission.task == "stationary" else _velocities(mission, numbers)
    first, last = numbers["task_cost_first"], numbers["task_cost_last"]
    return {
        f"{name}, mean": f"{numbers['task_cost_mean']:.2f} {unit}",
        "  first to last window": f"{first:.2f} to {last:.2f} {unit}",
    }


def _velocities(mission: Mission, numbers: Mapping[str, Any]) -> dict[str, str]:
    """Velocity variances; of a flock also whether it agreed on a velocity."""
    first, last = numbers["velocity_variance_first"], numbers["velocity_variance_last"]
    rows = {
        "velocity variance, mean": f"{numbers['velocity_variance_mean']:.4f} m²/s²",
        "  first to last window": f"{first:.4f} to {last:.4f} m²/s²",
    }
    left = numbers["velocity_variance_left"]
    if mission.task == "flocking" and left is not None:
        share = f"{left:.1%}" if left >= 0.001 else "under 0.1%"
        verdict = "yes" if left < AGREED else "no"
        rows[f"  flock agreed: under {AGREED:.0%} is left"] = f"{verdict}, {share}"
    return rows
