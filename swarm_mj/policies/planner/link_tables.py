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

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission import Mission
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.planner.snapshots import NUM_SENT, Proposals
from swarm_mj.protocol.packets import PacketField, bits_for, identity, times
from swarm_mj.radio.fading import NO_FADING, NO_LINE_OF_SIGHT
from swarm_mj.radio.links import Curves, Links, decode_curves, doubtful, probability_at
from swarm_mj.system.decibels import DB_PER_NEPER, from_db, to_db

BIN_DB = 2.0
LEAST_MARGIN_DB = -15.0  # of the lowest bin; packets that are expected to be weaker are not missed
NUM_BINS = 24
BIN_CENTRES_DB = LEAST_MARGIN_DB + BIN_DB * np.arange(NUM_BINS)

NOTHING = -1  # in place of the kind of a packet
MISSED = 0  # outcomes of a packet
DECODED = 1
NUM_OUTCOMES = 2
MAX_KINDS = 64  # that one robot notes
MAX_TIMES = 255  # that it notes one kind


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
DOUBTFUL_STDS = 3.0  # of the margin by errors of positions, within which outcomes say nothing
STEP_DB = 0.25  # to which tables are rounded
# The probability that a packet decodes, or not, against all laws: no single packet may rule out a
# hypothesis, since no law here is exactly true.
SURPRISE = 0.005

Counts = Int[np.ndarray, "N N K"]  # packets of i that j decoded, or missed, by bins of margin


def observe(
    listens: Bool[np.ndarray, "N"],
    heard: Int[np.ndarray, "N"],
    transmitted: Bool[np.ndarray, "N"],
    believed_mw: Float[np.ndarray, "N N"],
    prior: Links,
) -> Int[np.ndarray, "N"]:
    """Return the kind of packet that each robot notes of a slot in which it followed one plan.

    Only those listen here that know that all others follow plans, too; nobody else can say what was
    in the air. The plan was made by believed powers of i at j, [i, j]. Margins are counted from the
    links before anything was learned.
    """
    num_robots = len(heard)
    everyone = np.arange(num_robots)
    is_other = ~np.eye(num_robots, dtype=bool)
    arriving_mw = np.where(transmitted[:, None] & is_other, believed_mw, 0.0)  # of i at j
    is_decoded = heard != everyone
    # Whose packet it was: of one that was missed, the strongest that should have arrived.
    sender = np.where(is_decoded, heard, np.argmax(arriving_mw, axis=0))
    # A sum of its own: the packet that j decoded need not be the strongest by this belief.
    is_sender = everyone[:, None] == sender
    others_mw = np.sum(np.where(is_sender, 0.0, arriving_mw), axis=0)
    sinr = prior.received_mw[sender, everyone] / (prior.noise_mw + others_mw)
    margin = sinr / prior.threshold
    margin_db = to_db(np.maximum(margin, np.finfo(np.float64).tiny))
    nearest = np.floor((margin_db - LEAST_MARGIN_DB) / BIN_DB + 0.5).astype(np.int64)
    # A packet too weak for the lowest bin tells something if it is decoded, nothing if it is not.
    is_missed = np.any(arriving_mw > 0.0, axis=0) & (nearest >= 0)
    outcome = np.where(is_decoded, DECODED, MISSED)
    bins = np.clip(nearest, 0, NUM_BINS - 1)
    kind = np.ravel_multi_index((outcome, sender, bins), _kinds(num_robots))
    # Where the error of positions may well have decided, a packet teaches nothing of the channel.
    # Power falls with the distance squared.
    doubt_db = DOUBTFUL_STDS * 2.0 * DB_PER_NEPER / prior.distance_over_std[sender, everyone]
    is_telling = (is_decoded | is_missed) & (np.abs(margin_db) >= doubt_db)
    return np.where(listens & is_telling, kind, NOTHING)


def _kinds(num_robots: int) -> tuple[int, int, int]:
    """Return the shape of an array by kinds of packets: by outcome, sender and bin of the margin.

    A kind is a place in such an array, counted on row by row.
    """
    return NUM_OUTCOMES, num_robots, NUM_BINS


class Evidence:
    """All observations of a team, slot by slot."""

    def __init__(self, num_robots: int) -> None:
        self._slots: list[Int[np.ndarray, " N"]] = []  # the kind that j noted in each
        # [j, kind]: how often j noted each.
        self._times = np.zeros((num_robots, math.prod(_kinds(num_robots))), dtype=np.int64)

    def add(self, kinds: Int[np.ndarray, "N"]) -> None:
        """Note the next slot; robots whose notes are full count on only the kinds they have."""
        j = np.flatnonzero(kinds != NOTHING)
        times = self._times[j, kinds[j]]
        # Packets have room for MAX_KINDS kinds: a robot that has them all notes no other.
        has_room = np.count_nonzero(self._times[j], axis=1) < MAX_KINDS
        is_noted = np.where(times == 0, has_room, times < MAX_TIMES)
        self._times[j, kinds[j]] += is_noted
        self._slots.append(kinds.copy())
        self._slots[-1][j[~is_noted]] = NOTHING

    def counts(self, known_until: Int[np.ndarray, "N"]) -> tuple[Counts, Counts]:
        """Return how many packets were decoded, and missed, until each robot's last slot."""
        num_robots = len(known_until)
        kinds = np.array(self._slots, dtype=np.int64).reshape(-1, num_robots)  # [slot, j]
        is_past = np.arange(len(kinds))[:, None] <= known_until
        slot, j = np.nonzero((kinds != NOTHING) & is_past)
        times = np.zeros_like(self._times)
        # Unlike `+=`, this counts each time that a robot noted the same kind.
        np.add.at(times, (j, kinds[slot, j]), 1)
        by_outcome = times.reshape(num_robots, *_kinds(num_robots))
        return by_outcome[:, DECODED], by_outcome[:, MISSED]


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
    """Return those of a packet that is decoded, and missed: by bin, law and excess."""
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
