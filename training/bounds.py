"""A floor for teams at rest: an age of information that no policy can go below (`docs/bounds.md`).

    python training/bounds.py                    # training/results/floor.csv and exact.csv
    python training/bounds.py --teams 3 --seconds 60

The lemmas of `docs/bounds.md` are named where they are used. What is proven holds for every policy,
also for a centre that knows all, in each window after the start-up. `exact_age` finds the optimum
of teams of 3 to 6 robots, which the floor must not exceed. Index order: `i` sends, `j` receives.
"""

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from itertools import combinations
from pathlib import Path
from typing import Any, cast

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import shortest_path

from swarm_mj.cli import script
from swarm_mj.evaluation.published import TRANSMIT_POWER
from swarm_mj.mission import paper
from swarm_mj.protocol.timestamps import SLOTS_PER_WINDOW
from swarm_mj.radio.links import Links, air_of, links_between, lone_probabilities
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.radio.reception import decoded, incoming_at
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.fields import setting
from swarm_mj.system.packages import commit
from swarm_mj.system.writing import Output, check_outputs, write_csv

RESULTS = Path(__file__).resolve().parent / "results"
RANGE_RATIOS = TRANSMIT_POWER.xs
MOST_LINKS = 400  # of teams whose receptions are searched
SLACK = 1e-9  # of powers, so that rounding in a programme only raises the number of receptions
SMALL_TEAMS = {  # positions [m]; a packet reaches 250 m
    "2 robots, 100 m apart": ((0, 0), (100, 0)),
    "3 robots in range of each other": ((0, 0), (100, 0), (0, 100)),
    "3 robots in a line, 200 m apart": ((0, 0), (200, 0), (400, 0)),
    "4 robots in a square of 240 m": ((0, 0), (240, 0), (240, 240), (0, 240)),
    "4 robots in a line, 200 m apart": ((0, 0), (200, 0), (400, 0), (600, 0)),
}
CAP = 7  # slots: ages of small teams count as that at most; 6 and 8 give the same optima


def floor_windows(links: Links, seconds: float) -> float:
    """Return the proven floor of the mean age of all pairs, own age included [windows].

    More seconds for the search of Lemma 4 may raise it; it is proven for any number.
    """
    return floor_of(hop_counts(links), most_receptions(links, seconds))


def floor_of(hops: Float[np.ndarray, "N N"], receptions: int) -> float:
    """Return the floor where a slot has so few receptions at most [windows] (Lemma 5)."""
    informed = most_informed(hops, receptions)
    return float(np.sum(1.0 - informed / hops.size)) / SLOTS_PER_WINDOW


def hop_counts(links: Links) -> Float[np.ndarray, "N N"]:
    """Return the least slots from i to j: links are those that decode in silence; inf is never."""
    return shortest_path(lone_links(links).astype(float), unweighted=True)


def lone_links(links: Links) -> Bool[np.ndarray, "N N"]:
    """Return whether j decodes i when nobody else transmits."""
    return (lone_probabilities(links) > 0.0) & ~np.eye(len(links.received_mw), dtype=bool)


def most_informed(hops: Float[np.ndarray, "N N"], receptions: int) -> Float[np.ndarray, "L"]:
    """Return the most pairs (i, j), i = j included, of which j knows i since L slots ago (Lemma 5).

    For L of 1 and more, up to where that is all pairs.
    """
    informed = [float(len(hops))]
    length = 0
    while informed[-1] < hops.size:
        length += 1
        known = 2.0 ** (length - 1)  # at most, by any sender (Lemma 3)
        by_receptions = informed[-1] + receptions * min(known, len(hops) - 1)
        by_receivers = np.sum(np.minimum(2.0**length, np.sum(hops <= length, axis=0)))
        informed.append(min(by_receptions, float(by_receivers)))
        if length > hops.size:
            return np.array(informed[1:])  # the team is not connected
    return np.array(informed[1:])


def most_receptions(links: Links, seconds: float) -> int:
    """Return a number that the receptions of no slot exceed (Lemma 4).

    That is the dual bound of an integer programme: proven, also where the search is cut short. Of
    more links than `MOST_LINKS` none is made: there it would prove nothing in a minute.
    """
    trivial = len(links.received_mw) - 1  # a sender decodes nothing
    if np.count_nonzero(lone_links(links)) > MOST_LINKS:
        return trivial
    programme = _Programme(links)
    found = milp(
        -programme.is_reception.astype(float),
        constraints=programme.constraints(),
        integrality=np.ones(len(programme.is_reception)),
        bounds=Bounds(0, 1),
        options={"time_limit": seconds},
    )
    bound = found.mip_dual_bound
    if bound is None or not math.isfinite(bound):
        return trivial
    return min(trivial, math.floor(-bound + 1e-6))


class _Programme:
    """Variables: i transmits; and for each lone link, j decodes i."""

    def __init__(self, links: Links) -> None:
        power = links.received_mw / links.noise_mw
        self._power = power
        self._threshold = links.threshold
        self._num_robots = len(power)
        self._links = np.argwhere(lone_links(links))
        self.is_reception = np.arange(self._num_robots + len(self._links)) >= self._num_robots

    def constraints(self) -> LinearConstraint:
        """Return what Eqs. 3 and 4 make necessary."""
        rows = list(self._rows())
        row = np.concatenate([np.full(len(terms), r) for r, (terms, _) in enumerate(rows)])
        column = np.concatenate([list(terms) for terms, _ in rows])
        value = np.concatenate([list(terms.values()) for terms, _ in rows])
        shape = len(rows), len(self.is_reception)
        matrix = coo_matrix((value, (row, column.astype(int))), shape=shape)
        limits = np.array([limit for _, limit in rows])
        return LinearConstraint(matrix, -np.inf, cast(Any, limits))  # stubs want a number

    def _rows(self) -> Iterator[tuple[dict[int, float], float]]:
        """Return the terms and the upper limit of each constraint."""
        num_robots = self._num_robots
        for j in range(num_robots):
            heard = {int(i): num_robots + e for e, (i, to) in enumerate(self._links) if to == j}
            for i, e in heard.items():
                yield {e: 1.0, i: -1.0}, 0.0  # who is decoded transmits
            yield dict.fromkeys(heard.values(), 1.0) | {j: 1.0}, 1.0  # one packet, or its own
            for k in range(num_robots):
                jammed = {
                    e: 1.0 for i, e in heard.items() if k not in (i, j) and self._jams(k, i, j)
                }
                if jammed:
                    yield jammed | {k: 1.0}, 1.0
            for i, e in heard.items():
                yield from self._sum_of_interference(i, j, e)

    def _jams(self, k: int, i: int, j: int) -> bool:
        """Return whether j cannot decode i while k transmits."""
        return self._power[i, j] < self._threshold * (1.0 + self._power[k, j]) * (1.0 - SLACK)

    def _sum_of_interference(
        self, i: int, j: int, e: int
    ) -> Iterator[tuple[dict[int, float], float]]:
        """Return that j, if it decodes i, has no more interference than that allows (Eq. 3)."""
        room = (self._power[i, j] / self._threshold - 1.0) * (1.0 + SLACK) + SLACK
        others = [k for k in range(self._num_robots) if k not in (i, j)]
        terms = {k: min(float(self._power[k, j]), 2.0 * room) for k in others}
        if (excess := sum(terms.values()) - room) > 0.0:
            yield terms | {e: excess}, room + excess


def slots_of(links: Links) -> Int[np.ndarray, "A N"]:
    """Return whom each robot decodes, for every set of senders who are all decoded by somebody."""
    num_robots = len(links.received_mw)
    everyone = np.arange(num_robots)
    found = {tuple(everyone.tolist())}  # silence
    for size in range(1, num_robots):
        for senders in combinations(range(num_robots), size):
            transmits = np.isin(everyone, senders)
            air = air_of(links, transmits)
            heard = everyone.copy()
            for j in np.flatnonzero(~transmits).tolist():
                if air.strongest[j] > 0.0:
                    incoming = incoming_at(air, j)
                    heard[j] = decoded(incoming, j, links.noise_mw, links.threshold)
            found.add(tuple(heard.tolist()))
    return np.array(sorted(found))


def exact_age(links: Links, cap: int, sweeps: int = 400) -> tuple[float, float]:
    """Return limits of the least mean age of endless schedules, own age included [windows].

    Ages above `cap` slots count as that, so the first holds for every schedule; the second is that
    of a schedule if none of its ages is above the cap. Value iteration over all states that a team
    reaches from `cap` everywhere: the rise of the value in one sweep limits the mean.
    """
    after, cost = _graph(slots_of(links), cap)
    value = np.zeros(len(cost))
    low = 0.0
    high = np.inf
    for _ in range(sweeps):
        # From one window's end to the next. Half of each step stands still: no cycles in value.
        ahead = 0.5 * value + 0.5 * (cost + np.min(value[after], axis=1))
        rise = 2.0 * (ahead - value)
        low = max(low, float(rise.min()))
        high = min(high, float(rise.max()))
        value = ahead - ahead.min()
        if high - low < 1e-3:
            break
    return low / SLOTS_PER_WINDOW, high / SLOTS_PER_WINDOW


def _graph(
    slots: Int[np.ndarray, "A N"], cap: int
) -> tuple[Int[np.ndarray, "S P"], Float[np.ndarray, "S"]]:
    """Return each state's successors after a window, and its mean age [slots]."""
    num_robots = slots.shape[1]
    start = np.where(np.eye(num_robots, dtype=bool), 0, cap).astype(np.int8)
    index = {start.tobytes(): 0}
    states = [start]
    after = []
    for state in states:  # grows meanwhile
        nexts = []
        for first in _distinct(state[None], slots, cap):
            for second in _distinct(first[None], slots, cap):
                key = second.tobytes()
                if key not in index:
                    index[key] = len(states)
                    states.append(second)
                nexts.append(index[key])
        after.append(sorted(set(nexts)))
    width = max(map(len, after))
    padded = np.array([row + row[:1] * (width - len(row)) for row in after])
    return padded, np.mean(np.array(states, dtype=float), axis=(1, 2))


def _distinct(
    age: Int[np.ndarray, "1 N N"], slots: Int[np.ndarray, "A N"], cap: int
) -> Int[np.ndarray, "D N N"]:
    """Return the ages at a slot's end after every choice of senders, but those that others beat."""
    older = np.minimum(age[0] + 1, cap).astype(np.int8)  # [j, k]: of what j knows of k
    sent = older.copy()
    np.fill_diagonal(older, 0)
    np.fill_diagonal(sent, 0)
    merged = np.unique(np.minimum(older, sent[slots]), axis=0)
    is_beaten = np.zeros(len(merged), dtype=bool)
    for a in range(len(merged)):
        beats = np.all(merged <= merged[a], axis=(1, 2))
        is_beaten[a] = np.count_nonzero(beats) > 1
    return merged[~is_beaten]


@dataclass(frozen=True, kw_only=True)
class Floor:
    """A row of the table."""

    task: str
    num_robots: int
    range_ratio: float
    seed: int
    floor_windows: float
    mean_hops: float
    most_receptions: int
    seconds: float
    commit: str


@dataclass(frozen=True, kw_only=True)
class Exact:
    """A small team, for which the optimum was found."""

    team: str
    floor_windows: float
    optimum_windows: float
    ratio: float
    commit: str


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Which teams get a floor."""

    teams: int = setting(20, "of each range ratio", low=1, high=1000)
    seed: int = setting(4500, "of the first mission")
    robots: int = setting(40, "in a team", low=2, high=100)
    seconds: float = setting(2.0, "for the search of each team", low=0.1, high=1e4)
    out: Path = setting(
        RESULTS / "floor.csv", "the floors; exact.csv goes beside it", metavar="FILE.csv"
    )


def rows(settings: Settings, range_ratio: float) -> Iterator[Floor]:
    """Return the floor of each team."""
    for seed in range(settings.seed, settings.seed + settings.teams):
        mission = paper("stationary", num_robots=settings.robots, range_ratio=range_ratio)
        swarm = Swarm(mission, [seed])
        links = swarm.truth.links(swarm.states.position_m[0], 0)
        hops = hop_counts(links)
        receptions = most_receptions(links, settings.seconds)
        yield Floor(
            task=mission.task,
            num_robots=mission.num_robots,
            range_ratio=range_ratio,
            seed=seed,
            floor_windows=floor_of(hops, receptions),
            mean_hops=float(np.sum(hops)) / (hops.size - len(hops)),
            most_receptions=receptions,
            seconds=settings.seconds,
            commit=commit() or "",
        )


def mean_floor(table: Sequence[Floor], range_ratio: float) -> float:
    """Return the mean over the teams of a range ratio [windows]."""
    return float(np.mean([row.floor_windows for row in table if row.range_ratio == range_ratio]))


def exact_rows(seconds: float) -> Iterator[Exact]:
    """Return floor and optimum of the small teams."""
    radio = radio_of(paper("stationary"))
    for team, position_m in SMALL_TEAMS.items():
        links = links_between(radio, np.array(position_m, dtype=float))
        floor = floor_windows(links, seconds)
        optimum, _ = exact_age(links, CAP)
        yield Exact(
            team=team,
            floor_windows=floor,
            optimum_windows=optimum,
            ratio=floor / optimum,
            commit=commit() or "",
        )


def run(settings: Settings) -> int:
    """Write both tables and print the means; return the exit code."""
    exact = settings.out.with_name("exact.csv")
    check_outputs(Output("table", settings.out, ".csv"), Output("small teams", exact, ".csv"))
    table: list[Floor] = []
    for range_ratio in RANGE_RATIOS:
        table += rows(settings, range_ratio)
        print(f"range ratio {range_ratio:g}: {mean_floor(table, range_ratio):.2f} windows")
    # The floors last: `results.py` takes both tables as made where these are there.
    _write(exact, Exact, list(exact_rows(settings.seconds)))
    _write(settings.out, Floor, table)
    return 0


def _write(path: Path, kind: type[Floor | Exact], table: Sequence[Floor | Exact]) -> None:
    write_csv(path, [field.name for field in fields(kind)], (asdict(row) for row in table))


if __name__ == "__main__":
    sys.exit(script(Settings, run))
