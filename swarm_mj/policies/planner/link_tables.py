"""Tables of links, fitted to packets that robots decoded or missed, and links corrected by them.

A robot that knows the schedule knows who transmitted in the slot before, and so which packet it
should have decoded. It notes the kind of that packet: its sender, its margin in bins, and whether
it was decoded. The margin is that of the SINR over the threshold, as was believed before anything
was learned. Index order: `[j, i]`: robot j listens to robot i.

A link's excess is how much stronger it is than was believed, in dB, the same in both directions.
Every pair of a law of fades and a prior of the excess is a hypothesis. The most probable one is
taken, unless the channel that was believed explains the observations about as well; then each
link's excess follows by Bayes' rule. Packets carry what robots observed, and two tables: the one
that the sender plans by, and the best of the next.

Axes: K bins of the margin, F laws of fades and losses, X values of the excess, P priors of the
excess, and L links, one for each pair of robots.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.mission import Mission
from swarm_mj.policies.planner.link_evidence import (
    BIN_DB,
    LEAST_MARGIN_DB,
    MAX_KINDS,
    MAX_TIMES,
    NUM_BINS,
    Counts,
    Evidence,
)
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.planner.snapshots import NUM_SENT, Proposals
from swarm_mj.protocol.packets import PacketField, bits_for, identity, times
from swarm_mj.radio.fading import NO_FADING, NO_LINE_OF_SIGHT
from swarm_mj.radio.links import Curves, Links, decode_curves, doubtful, probability_at
from swarm_mj.system.decibels import from_db

BIN_CENTRES_DB = LEAST_MARGIN_DB + BIN_DB * np.arange(NUM_BINS)


class Law(NamedTuple):
    """How packets are lost on all links alike."""

    rician_k: float  # of fading
    loss: float  # share of packets that are lost whatever their power


EXCESS_DB = np.arange(-30.0, 18.1, 3.0)  # the values that are distinguished
ERASURES = (0.0, 0.15, 0.3, 0.45)
# The first one is what robots believe: nothing fades or is lost.
LAWS = (
    *(Law(NO_FADING, loss) for loss in ERASURES),
    *(Law(NO_LINE_OF_SIGHT, loss) for loss in ERASURES),
)
SPREADS_DB = (3.0, 6.0, 9.0)  # of normal priors of a link's excess
BLOCKED_SHARES = (0.3, 0.6)  # of priors in which links are as believed, or blocked
BLOCKED_BELOW_DB = -20.0
STEP_DB = 0.25  # to which tables are rounded
# The probability that a packet decodes, or not, against all laws: no single packet may rule out a
# hypothesis, since no law here is exactly true.
SURPRISE = 0.005


@dataclass(frozen=True, kw_only=True)
class LinkTable:
    """One robot's estimate of all links; packets carry it."""

    law: int  # in `LAWS`
    mean_db: Float[np.ndarray, "N N"]  # excess of each link, as expected [dB]
    std_db: Float[np.ndarray, "N N"]  # its standard deviation [dB]

    @cached_property
    def changes_nothing(self) -> bool:
        """True if the plan may stay: losses that affect all links equally favour no other."""
        fades = LAWS[self.law].rician_k != NO_FADING
        return not (fades or np.any(self.mean_db) or np.any(self.std_db))


@dataclass(frozen=True, kw_only=True)
class Tables(Proposals):
    """The tables of all robots at one time; the best is that of the youngest knowledge."""

    table: Callable[[int], LinkTable]  # of one robot, fitted when asked for


def tables_of(
    evidence: Evidence, known_until: Int[np.ndarray, "N N"], settings: PlannerSettings
) -> Tables:
    """Return what follows if [j, i] is the last slot of which j knows what i observed."""
    # The sum of a row is larger the younger what j knows. Of equals, the lowest identity is best.
    youngest_first = np.argsort(-np.sum(known_until, axis=1), kind="stable")
    rank = np.argsort(youngest_first)

    def table(owner: int) -> LinkTable:
        decoded, missed = evidence.counts(known_until[owner])
        return fit(decoded, missed, settings)

    return Tables(rank=rank, held=np.arange(len(rank)), table=cache(table))


def fit(decoded: Counts, missed: Counts, settings: PlannerSettings) -> LinkTable:
    """Return the table that follows from packets decoded and missed, rounded as packets carry it.

    Rounding here rather than on the air keeps the plan of a table's owner that of everyone.
    """
    num_robots = len(decoded)
    one, other = np.triu_indices(num_robots, 1)  # the two robots of each link
    # A link is the same in both directions, and so is what was observed of it.
    link_decoded = (decoded + decoded.transpose(1, 0, 2))[one, other]
    link_missed = (missed + missed.transpose(1, 0, 2))[one, other]
    prior = _priors()
    # How probable what was observed of a link is, if a law holds and the link has some excess. As
    # logarithms, relative to the most probable excess: products of many packets would be 0.
    log_decoded, log_missed = _log_probabilities()
    log_likelihood = np.einsum("LK,KFX->LFX", link_decoded, log_decoded)
    log_likelihood += np.einsum("LK,KFX->LFX", link_missed, log_missed)
    most = log_likelihood.max(axis=2, keepdims=True)
    likelihood = np.exp(log_likelihood - most)
    # The same if a prior of the excess holds as well, and from it the best of such hypotheses.
    of_link = np.einsum("LFX,PX->LFP", likelihood, prior) + np.finfo(np.float64).tiny
    log_evidence = np.sum(np.log(of_link) + most, axis=0)
    law, of_prior = _best(log_evidence, settings.min_log_odds)
    # Bayes' rule: the probability of each excess is its prior times its likelihood, to a factor.
    posterior = likelihood[:, law] * prior[of_prior]
    posterior /= posterior.sum(axis=1, keepdims=True)
    mean_db = posterior @ EXCESS_DB
    std_db = np.sqrt(np.maximum(posterior @ EXCESS_DB**2 - mean_db**2, 0.0))

    def rounded(of_links: Float[np.ndarray, "L"]) -> Float[np.ndarray, "N N"]:
        """Return a number of each link by its two robots, in either order [dB]."""
        table = np.zeros((num_robots, num_robots))
        table[one, other] = STEP_DB * np.rint(of_links / STEP_DB)
        table[other, one] = table[one, other]
        return table

    return LinkTable(law=law, mean_db=rounded(mean_db), std_db=rounded(std_db))


def corrected(links: Links, table: LinkTable, settings: PlannerSettings) -> Links:
    """Return links as a table has them, cautious where it is doubtful.

    A packet is expected to be weaker than in the mean, and to interfere more: a plan that fails
    costs more than one that is too careful.
    """
    weaker = from_db(table.mean_db - settings.cautious_stds * table.std_db)
    louder = from_db(table.mean_db + settings.disturbing_stds * table.std_db)
    links = links._replace(
        received_mw=links.received_mw * weaker,
        interference_mw=links.interference_mw * louder,
    )
    return doubtful(links, _curves(table.law), np.minimum(table.std_db, settings.max_std_db))


def _best(log_evidence: Float[np.ndarray, "F P"], min_log_odds: float) -> tuple[int, int]:
    """Return the most probable law and prior, at a price for each step from the believed ones.

    A law that loses packets is a step away, one that fades a step more, and so is another prior.
    """
    steps = np.zeros(len(LAWS))
    for f, law in enumerate(LAWS):
        if f > 0:  # the first law is the believed one, in which nothing is lost or fades
            steps[f] += 1.0
        if law.rician_k != NO_FADING:
            steps[f] += 1.0
    log_odds = log_evidence - min_log_odds * steps[:, None]
    log_odds[:, 1:] -= min_log_odds  # the first prior is the believed one
    best_law, best_prior = np.unravel_index(np.argmax(log_odds), log_odds.shape)
    return int(best_law), int(best_prior)


@cache
def _curves(law: int) -> Curves:
    """Return how probably packets decode by a law, at any margin, as `decode_curves`."""
    return decode_curves(LAWS[law].rician_k, 1.0 - LAWS[law].loss)


@cache
def _log_probabilities() -> tuple[Float[np.ndarray, "K F X"], Float[np.ndarray, "K F X"]]:
    """Return the log-probabilities that a packet is decoded, and missed: by bin, law, excess."""
    margin_db = BIN_CENTRES_DB[:, None] + EXCESS_DB[None, :]
    # A link's margin lies somewhere in its bin, always at the same place. So for either outcome it
    # is taken to be where that is most probable; else what is certain would look like luck.
    decoded = _decodes(margin_db + BIN_DB / 2.0)
    missed = 1.0 - _decodes(margin_db - BIN_DB / 2.0)
    possible = 1.0 - 2.0 * SURPRISE
    return np.log(SURPRISE + possible * decoded), np.log(SURPRISE + possible * missed)


def _decodes(margin_db: Float[np.ndarray, "K X"]) -> Float[np.ndarray, "K F X"]:
    """Return how probably a packet decodes, by each law."""
    num_bins, num_excesses = margin_db.shape
    ratio = from_db(margin_db)
    probability = np.empty((num_bins, len(LAWS), num_excesses))
    for f in range(len(LAWS)):
        curves = _curves(f)
        for k in range(num_bins):
            for x in range(num_excesses):
                probability[k, f, x] = probability_at(curves, 0, float(ratio[k, x]))
    return probability


@cache
def _priors() -> Float[np.ndarray, "P X"]:
    """Return distributions of a link's excess; by the first, beliefs are right."""
    is_expected = (EXCESS_DB == 0.0).astype(np.float64)
    is_blocked = (EXCESS_DB < BLOCKED_BELOW_DB).astype(np.float64)
    normal = [np.exp(-0.5 * (EXCESS_DB / spread_db) ** 2) for spread_db in SPREADS_DB]
    num_blocked = is_blocked.sum()
    blocked = [
        (1.0 - share) * is_expected + share * is_blocked / num_blocked for share in BLOCKED_SHARES
    ]
    priors = np.stack([is_expected, *normal, *blocked])
    return priors / priors.sum(axis=1, keepdims=True)


def link_fields(mission: Mission) -> tuple[PacketField, ...]:
    """Return the fields of as many observations as robots may note, and of two tables of links."""
    num_robots = mission.num_robots
    num_noted = num_robots * MAX_KINDS
    num_links = NUM_SENT * num_robots * (num_robots - 1) // 2
    in_table = {"bits": 8, "count": num_links, "step": STEP_DB, "unit": "dB"}
    return (
        PacketField(name="slot since which each robot plans", bits=16, count=num_robots),
        PacketField(name="whether each robot hears of all", bits=1, count=num_robots),
        times(identity("sender of a kind of packet", mission), num_noted),
        PacketField(name="its margin", bits=bits_for(NUM_BINS), count=num_noted),
        PacketField(name="whether it was decoded", bits=1, count=num_noted),
        PacketField(name="how often", bits=bits_for(MAX_TIMES + 1), count=num_noted),
        times(identity("owner of the table", mission), NUM_SENT),
        PacketField(name="how much its owner knew", bits=32, count=NUM_SENT),
        PacketField(name="law of fades and losses", bits=bits_for(len(LAWS)), count=NUM_SENT),
        PacketField(name="mean excess of a link, in the table", low=-32.0, **in_table),
        PacketField(name="standard deviation of a link, in the table", **in_table),
    )
