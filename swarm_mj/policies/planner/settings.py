"""All numbers of the planner that were chosen by trial: their units, meanings and origins.

Unless a group says otherwise, a value is the best of a few that were tried on 20 missions with
seeds from 1000, mostly of 40 robots, at rest and walking (`training/RESULTS.md`). A round is N
windows, where N is the size of the team.
"""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class PlannerSettings:
    """Everything about the planner that was tuned."""

    # Epochs: every snapshot serves one of them.
    first_epoch_rounds: float = 1.0  # before the first snapshots are taken [rounds]
    early_epoch_rounds: float = 0.25  # each of the two epochs after it [rounds]
    epoch_rounds: float = 0.5  # all others; a snapshot must reach the whole team [rounds]
    min_early_epoch_windows: int = 2  # shortest of the first three [windows]
    min_epoch_windows: int = 10  # shortest of the others [windows]
    forget_every: int = 5  # of these epochs, teams at rest plan one from nothing, to agree again

    # The discovery: who transmits while robots have yet to hear of each other.
    transmitters_per_reach: float = 0.4  # at once, per area that a lone packet covers [1]
    max_transmitters: int = 8  # at once
    num_fast_rounds: int = 1  # in which that many transmit at once
    later_share: float = 0.5  # of these transmit at once from then on [1]
    polite_ranges: float = 1.5  # a transmitter nearer than that comes first [ranges]
    num_orders: int = 40  # rounds after which the orders repeat

    # The search for robots that were not heard from for long.
    search_rounds: float = 5.0  # when the discovery ends and the search begins [rounds]
    latest_search_windows: int = 200  # when it begins at the latest [windows]
    search_every_windows: int = 5  # how often, while robots are missing [windows]

    # Snapshots: which robots count as fresh, and how far beliefs err.
    fresh_rounds: float = 1.0  # a robot not heard from for longer is missing [rounds]
    min_fresh_windows: float = 20.0  # but never earlier [windows]
    steady_windows: float = 15.0  # for which a robot is expected to keep its velocity [windows]
    std_per_distance: float = 0.45  # of the distance that robots drift apart: how far beliefs err
    # At rest, a team of which fewer are fresh is not scattered but flies by plans that differ.
    min_fresh_share: float = 0.75

    # Plans: looking ahead takes a time that grows with N³, so large teams do not. Where nobody
    # moves, plans come true as they are, and looking further ahead pays.
    rest_lookahead: tuple[int, int] = (6, 6)  # width and depth, as in `Problem`
    moving_lookahead: tuple[int, int] = (4, 4)
    max_lookahead_robots: int = 50  # largest team that looks ahead
    gone_rounds: float = 3.0  # a robot not heard from for longer is planned without [rounds]
    min_round_windows: int = 20  # in which this round, and those of tables, count [windows]

    # The heuristic weights of news, by receiver and subject, chosen on 8 missions at rest, of 10
    # and 40 robots at range ratios from 0.2 to 1, and on 20 walking ones.
    downstream_exponent: float = 0.6  # of the number of robots that a receiver passes news on to
    hops_exponent: float = -0.3  # of the number of hops that the news has come
    # The least share of a slot's value that must remain when another robot transmits is the first
    # of these, plus the others times what they name, up to the last.
    share_unlinked: float = 0.95
    share_per_link: float = -0.3  # times the share of all pairs that are linked
    share_per_std: float = 3.0  # times the relative standard deviation of distances
    share_isolated: float = 0.1  # if a robot has no link
    max_share: float = 1.05
    min_probability: float = 0.05  # links that decode more rarely count as none [1]
    drawn_slots: int = 40  # for which teams at rest plan with places drawn, where they doubt them
    drawn_share: float = 0.5  # of the standard deviation of their positions that is drawn [1]
    slack_hops: float = 0.25  # by which a path may exceed the shortest, and still is one [hops]

    # Turns of teams at rest beside their plans (`assent.py`), chosen on 12 missions of 300 windows
    # and seeds from 910000, of 7 to 12 robots at rest: noise, clocks, failures, walls and fades.
    min_planned_robots: int = 7  # fewer take turns only: with 6 a plan gains a tenth [robots]
    # A robot not heard of for longer is overdue; N windows are one. With 2, teams in short ranges
    # could stay where the slots lost to turns kept robots overdue, and those kept the turns: of 40
    # teams from seed 950000 at each range ratio and size from 7 to 15, 4 helps in all, 3 in most.
    overdue_rounds: float = 4.0
    min_turns_every: int = 3  # least distance of the slots for turns, while needed [slots]
    min_turns_every_without_payload: int = 8  # the same where they are always needed [slots]
    turns_every_robots: float = 0.25  # their distance is this for each robot, if that is more

    # Tables of links in teams at rest, chosen on four missions of 240 to 300 windows, with seeds
    # from 70000, under shadowing of 6 dB and in the arena `blocks`.
    spread_rounds: float = 0.75  # that a table is given to reach everyone before it is flown by
    flown_rounds: float = 1.5  # for which it is flown by at least, before the next is [rounds]
    first_table_rounds: float = 3.0  # when the first is flown by [rounds]
    min_log_odds: float = 5.0  # of a hypothesis, over the channel that was believed
    cautious_stds: float = 0.5  # by which a packet is expected to be weaker than in the mean
    disturbing_stds: float = 1.0  # by which it is expected to disturb others more
    max_std_db: float = 2.0  # most that schedulers assume of a link, as their errors last [dB]
