"""The numbers of one flight: for the terminal and for `--json`."""

import math
from dataclasses import fields
from typing import Any

import numpy as np
from jaxtyping import Float

from swarm_mj.api.flight_summary import FlightSummary
from swarm_mj.control.motion import Flocking
from swarm_mj.mission import Mission
from swarm_mj.mission.bodies import POINT
from swarm_mj.mission.faults import MIN_SURVIVORS
from swarm_mj.mission.words import bodies_in_words, robots_in_words
from swarm_mj.policies.about import NO_PAYLOAD
from swarm_mj.policies.policy import Policy
from swarm_mj.protocol.agreement import AGREED, perfect_rate
from swarm_mj.protocol.mission_costs import AOI, TASK_COST, VELOCITY_VARIANCE, MissionCost
from swarm_mj.protocol.packets import BITS_PER_BYTE
from swarm_mj.radio.words import bits_per_second, where_flown
from swarm_mj.simulation.rollout import Count, FlownCosts, SomeCount, Summary
from swarm_mj.system.shares import percent

CENTRE = "no: a centre knows all positions"
FATES = {  # rows of the table: a count among the numbers, and its share of the packets sent
    "  heard by at least one robot": "packets_heard",
    "  delivered": "packets_delivered",
    "  lost": "packets_lost",
    "  answered, and the answer heard": "packets_answered",
}


def flight_numbers(mission: Mission, policy: Policy, summary: Summary) -> dict[str, Any]:
    """Return the summary of the one mission flown, and its packets.

    Args:
        mission: What was flown.
        policy: Who sent when.
        summary: What it cost.

    Returns:
        The fields of `Summary` as plain numbers, then the packet's size [bytes], the team's rate
        [bytes/s], the share of the first window's velocity variance that is left, and what the
        policy is; None is what is not defined.
    """
    numbers: dict[str, Any] = {}
    for spec in fields(FlownCosts):
        value = getattr(summary, spec.name)
        if isinstance(value, np.ndarray):
            value = plain_number(value, is_count=spec.type in (Count, SomeCount))
        numbers[spec.name] = value
    first = numbers["velocity_variance_first"]
    last = numbers["velocity_variance_last"]
    packet_bytes = policy.packet(mission).num_bytes
    flown_s = numbers["num_windows"] * mission.window_s
    return numbers | {
        "packet_bytes": packet_bytes,
        "bytes_per_second": packet_bytes * numbers["packets_transmitted"] / flown_s,
        "velocity_variance_left": last / first if first > 0.0 else None,
        "payload": policy.payload,
        "is_centralised": policy.is_centralised,
    }


def flight_title(mission: Mission, policy: str, seed: int) -> str:
    """Return mission, policy and seed in a line."""
    team = robots_in_words(mission)
    if mission.collide:
        team += " that collide"
    if mission.failure_fraction:
        team += f", {mission.failure_fraction:.0%} of them off half-way"
    bodies = bodies_in_words(mission.robot, vars(mission))
    words = [mission.task, policy, team, *bodies, f"seed {seed}", *where_flown(mission)]
    return ", ".join(words)


def flight_rows(mission: Mission, summary: FlightSummary) -> dict[str, str]:
    """Return the rows of a flight's table.

    Args:
        mission: What was flown.
        summary: What it cost.
    """
    num_windows = summary.num_windows
    rows = {
        f"windows of {mission.window_s:g} s flown": f"{num_windows} in {summary.wall_seconds:.2f} s"
    }
    rows[f"{AOI.title}, mean"] = _windows(summary.aoi_mean, mission, AOI.digits)

    complete = summary.complete_window
    if complete is None:
        shown_how = f"never; {percent(summary.heard_share)} of pairs at the end"
    else:
        shown_how = f"after {_windows(complete, mission, 0)}"
    rows["all pairs first informed"] = shown_how

    hops = summary.hops_mean
    rows["hops, mean"] = f"{hops:.2f}" if hops else "-"
    rows |= _packets(summary)

    carried = "the sender's buffer"
    if summary.payload != NO_PAYLOAD:
        carried += f" and {summary.payload}"
    rows["packets carry"] = carried
    rate = bits_per_second(BITS_PER_BYTE * summary.bytes_per_second)
    rows["  bytes each"] = f"{summary.packet_bytes:,}"
    rows["  sent by the team"] = rate
    rows["decentralised"] = CENTRE if summary.is_centralised else "yes"
    rows |= _task_costs(mission, summary)
    if summary.crashed is not None:
        rows["robots crashed"] = _crashed(mission.num_robots, summary.crashed)
    if summary.energy_mean_j is not None:
        rows["energy per robot; most"] = (
            f"{summary.energy_mean_j:,.0f} J; {summary.energy_worst_j:,.0f} J"
        )
    if mission.num_failures:
        rows["robots switched off half-way"] = f"{mission.num_failures}; not counted from then on"
    return rows


def plain_number(value: Float[np.ndarray, "1"], *, is_count: bool = False) -> int | float | None:
    """Return the number of the one mission, whole if it counts; None where it is not defined."""
    number = float(value[0])
    if math.isnan(number):
        return None
    return int(number) if is_count else number


def _windows(value: float | int, mission: Mission, digits: int) -> str:
    """Return a duration in windows, and in seconds."""
    number = f"{value:.{digits}f}"
    windows = "1 window" if number == "1" else f"{number} windows"
    return f"{windows} ({value * mission.window_s:.2g} s)"


def _packets(summary: FlightSummary) -> dict[str, str]:
    """Return the packets' fates: broadcasts are heard or not, addressed ones delivered or lost."""
    sent = summary.packets_sent
    is_broadcast = summary.packets_attempted is None
    title = "packets broadcast" if is_broadcast else "packets sent, each to one robot"
    rows = {title: f"{sent} ({sent / summary.num_windows:.1f} a window)"}
    for label, name in FATES.items():
        count = summary[name]
        if count is None:  # of packets of the other kind
            continue
        rows[label] = f"{count} ({percent(count / sent)})" if sent else f"{count}"
    if is_broadcast:
        hearers = summary.hearers_per_packet
        rows["  robots that heard a packet, mean"] = "-" if hearers is None else f"{hearers:.2f}"
    else:
        rows["  overheard by other robots"] = f"{summary.packets_overheard} times"
    return rows


def _crashed(num_robots: int, num_crashed: int) -> str:
    """Return how many robots crashed, in words."""
    if num_crashed == 0:
        return "none"
    if num_robots - num_crashed < MIN_SURVIVORS:
        return f"{num_crashed} of {num_robots}; two radios stay on"
    return f"{num_crashed} of {num_robots}; off from then on"


def _task_costs(mission: Mission, summary: FlightSummary) -> dict[str, str]:
    """Return the cost of the task, if it has one; that of flocks is the velocity variance."""
    name = summary.task_cost_name
    if name not in (None, Flocking.cost_name):
        return _cost_rows(summary, TASK_COST, name=name, unit=summary.task_cost_unit or "")
    if name is None and not mission.flocks:  # no news changes the velocities of a walk
        return {}
    cost = VELOCITY_VARIANCE
    rows = _cost_rows(summary, cost, name=cost.title, unit=cost.unit)
    left = summary.velocity_variance_left
    if mission.flocks and left is not None:
        share = f"{left:.1%}" if left >= 0.001 else "under 0.1%"
        agreed = summary.agreed_window
        if agreed is None:
            verdict = f"no, {share}"
        else:
            verdict = f"from window {agreed} on ({agreed * mission.window_s:.2g} s)"
        rows[f"  flock agreed: under {AGREED:.0%} is left"] = verdict
        if summary.decay_rate is not None:
            rows["  falls at first by"] = _fall(mission, summary.decay_rate)
        if summary.strayed:
            rows["  robots out of everyone's range"] = f"{summary.strayed} at the end"
    return rows


def _fall(mission: Mission, decay_rate: float) -> str:
    """Return how fast the variance falls; of points, beside the law of perfect knowledge."""
    fall = f"{percent(1.0 - math.exp(-decay_rate))} a window"
    if mission.robot != POINT:  # bodies follow their set points in their own time
        return fall
    law = 1.0 - math.exp(-perfect_rate(mission.window_s))
    return f"{fall} ({percent(law)} if all knew all)"


def _cost_rows(
    summary: FlightSummary, cost: MissionCost, *, name: str, unit: str
) -> dict[str, str]:
    """Return a cost's mean over windows, and what it was at the start and the end."""
    mean = summary[f"{cost.column}_mean"]
    first = summary[f"{cost.column}_first"]
    last = summary[f"{cost.column}_last"]
    digits = cost.digits
    return {
        f"{name}, mean": f"{mean:.{digits}f} {unit}",
        "  first to last window": f"{first:.{digits}f} to {last:.{digits}f} {unit}",
    }
