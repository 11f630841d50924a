"""Tables of links, fitted to what robots observed, and links corrected by them.

A link's excess is how much stronger it is than was believed, in dB, the same in both directions.
Every pair of a law of fades and a prior of the excess is a hypothesis. The most probable one is
taken, unless the channel that was believed explains the observations about as well; then each
link's excess follows by Bayes' rule. Packets carry what robots observed, and two tables: the one
that the sender plans by, and the best of the next.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.mission import Mission
from swarm_mj.policies.planner.link_evidence import (
    BIN_CENTRES_DB,
    BIN_DB,
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

EXCESS_DB = np.arange(-30.0, 18.1, 3.0)  # the values that are distinguished
ERASURES = (0.0, 0.15, 0.3, 0.45)
LAWS = tuple((rician_k, loss) for rician_k in (NO_FADING, NO_LINE_OF_SIGHT) for loss in ERASURES)
SPREADS_DB = (0.0, 3.0, 6.0, 9.0)  # of normal priors; the first says that beliefs are right
BLOCKED_SHARES = (0.3, 0.6)  # of priors in which links are as believed, or blocked
BLOCKED_BELOW_DB = -20.0
STEP_DB = 0.25  # to which tables are rounded
SURPRISE = 0.005  # probability that a packet decodes, or not, against all laws: no single
# packet may rule out a hypothesis, since no law here is exactly true


@dataclass(frozen=True, kw_only=True)
class LinkTable:
    """One robot's estimate of all links; packets carry it."""

    law: int  # in `LAWS`
    mean_db: Float[np.ndarray, "N N"]  # excess of each link, as expected [dB]
    std_db: Float[np.ndarray, "N N"]  # its standard deviation [dB]

    @cached_property
    def changes_nothing(self) -> bool:
        """True if the plan may stay: losses that affect all links equally favour no other."""
        fades = LAWS[self.law][0] != NO_FADING
        return not (fades or np.any(self.mean_db) or np.any(self.std_db))


@dataclass(frozen=True, kw_only=True)
class Tables(Proposals):
    """The tables of all robots at one time; the best is that of the youngest knowledge."""

    table: Callable[[int], LinkTable]  # of one robot, fitted when asked for


def tables_of(
    evidence: Evidence, known_until: Int[np.ndarray, "N N"], settings: PlannerSettings
) -> Tables:
    """Return what follows if [j, i] is the last slot of which j knows what i observed."""
    rank = np.argsort(np.argsort(-np.sum(known_until, axis=1), kind="stable"))

    def table(owner: int) -> LinkTable:
        decoded, missed = evidence.counts(known_until[owner])
        return fit(decoded, missed, settings)

    return Tables(rank=rank, held=np.arange(len(rank)), table=cache(table))


def fit(decoded: Counts, missed: Counts, settings: PlannerSettings) -> LinkTable:
    """Return the table that follows from packets decoded and missed, rounded as packets carry it.

    Rounding here rather than on the air keeps the plan of a table's owner that of everyone.
    """
    num_robots = len(decoded)
    log_decoded, log_missed = _log_probabilities()
    prior = _priors()
    one, other = np.triu_indices(num_robots, 1)
    # A link is the same in both directions, and so is what was observed of it.
    link_decoded = (decoded + decoded.transpose(1, 0, 2))[one, other]
    link_missed = (missed + missed.transpose(1, 0, 2))[one, other]
    log_likelihood = np.einsum("lk,kfx->lfx", link_decoded, log_decoded)
    log_likelihood += np.einsum("lk,kfx->lfx", link_missed, log_missed)
    most = log_likelihood.max(axis=2, keepdims=True)
    likelihood = np.exp(log_likelihood - most)
    evidence = np.einsum("lfx,px->lfp", likelihood, prior) + np.finfo(np.float64).tiny
    law, of_prior = _best(np.sum(np.log(evidence) + most, axis=0), settings.min_log_odds)
    weight = likelihood[:, law] * prior[of_prior]
    weight /= weight.sum(axis=1, keepdims=True)
    mean_db = weight @ EXCESS_DB
    std_db = np.sqrt(np.maximum(weight @ EXCESS_DB**2 - mean_db**2, 0.0))
    table = np.zeros((2, num_robots, num_robots))
    rounded_db = STEP_DB * np.rint(np.stack([mean_db, std_db]) / STEP_DB)
    table[:, one, other] = table[:, other, one] = rounded_db
    return LinkTable(law=law, mean_db=table[0], std_db=table[1])


def corrected(links: Links, table: LinkTable, settings: PlannerSettings) -> Links:
    """Return links as a table has them, cautious where it is doubtful.

    A packet is expected to be weaker than in the mean, and to interfere more: a plan that fails
    costs more than one that is too careful.
    """
    weaker = 10.0 ** ((table.mean_db - settings.cautious_stds * table.std_db) / 10.0)
    louder = 10.0 ** ((table.mean_db + settings.disturbing_stds * table.std_db) / 10.0)
    links = links._replace(
        received_mw=links.received_mw * weaker,
        interference_mw=links.interference_mw * louder,
    )
    return doubtful(links, _curves(table.law), np.minimum(table.std_db, settings.max_std_db))


def _best(explained: Float[np.ndarray, "F P"], min_log_odds: float) -> tuple[int, int]:
    """Return the most probable law and prior, at a price for each step from the believed ones."""
    steps = (np.arange(len(LAWS)) > 0).astype(np.float64)
    steps += [rician_k != NO_FADING for rician_k, _ in LAWS]
    log_odds = explained - min_log_odds * steps[:, None]
    log_odds[:, 1:] -= min_log_odds
    law, prior = np.unravel_index(np.argmax(log_odds), log_odds.shape)
    return int(law), int(prior)


@cache
def _curves(law: int) -> Curves:
    rician_k, loss = LAWS[law]
    return decode_curves(rician_k, 1.0 - loss)


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
    ratios, laws = (10.0 ** (margin_db / 10.0)).tolist(), range(len(LAWS))
    return np.array(
        [[[probability_at(_curves(f), 0, x) for x in row] for f in laws] for row in ratios]
    )


@cache
def _priors() -> Float[np.ndarray, "P X"]:
    """Return distributions of a link's excess."""
    is_expected = (EXCESS_DB == 0.0).astype(np.float64)
    is_blocked = (EXCESS_DB < BLOCKED_BELOW_DB).astype(np.float64)
    normal = [np.exp(-0.5 * (EXCESS_DB / spread_db) ** 2) for spread_db in SPREADS_DB[1:]]
    num = is_blocked.sum()
    blocked = [(1.0 - x) * is_expected + x * is_blocked / num for x in BLOCKED_SHARES]
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
