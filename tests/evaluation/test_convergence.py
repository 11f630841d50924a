"""A claim about missions is decided by as few of them as it takes, in the order of their seeds."""

import math

import numpy as np
import pytest

from swarm_mj.control.motion import Flocking
from swarm_mj.evaluation.convergence import ConvergenceBatch, Goal, converging, fly_to_convergence
from swarm_mj.evaluation.engines import Local
from swarm_mj.evaluation.sequential import share_bounds
from swarm_mj.evaluation.study import Study
from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.components import Components
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm

SHORT = paper("flocking", num_robots=8, num_windows=60, range_ratio=0.5)


class Rest(Flocking):
    """A controller that brakes, with a cost of its own."""

    cost_name = "mean speed"
    cost_unit = "m/s"

    def __call__(self, _buffers, states):
        return -states.velocity_mps

    def cost(self, states):
        return np.mean(np.linalg.norm(states.velocity_mps, axis=2), axis=1)


def study(mission=SHORT, policy="tdma", episodes=200, **components):
    return Study(
        policies=(policy,),
        regimes=(mission,),
        episodes=episodes,
        seed=40,
        components=Components(**components),
    )


class OutOfOrder:
    """An engine whose later pieces are done first."""

    def run(self, work, pieces):
        for index in reversed(range(len(pieces))):
            yield index, work(pieces[index])


def windows_of(seeds):
    """From which window on each mission's flock has agreed, by `summarise`."""
    swarm = Swarm(SHORT, seeds)
    return summarise(rollout(swarm, make_policy("tdma", SHORT))).agreed_window


def test_missions_are_flown_until_the_claim_is_decided():
    """Batches of 25: no more than it takes, and what is found is what the missions are."""
    found = list(converging(study(), Goal(within_s=5.0, share=0.5), Local()))
    last = found[-1]
    assert [each.num_missions for each in found] == list(range(25, last.num_missions + 1, 25))
    assert [each.verdict for each in found] == ["not decided"] * (len(found) - 1) + ["holds"]
    assert last
    expected = windows_of(range(40, 40 + last.num_missions))
    np.testing.assert_array_equal(last.window, expected)
    assert last.num_held == np.sum(expected <= 50)
    assert last.interval == share_bounds(last.num_held, last.num_missions, 0.95)
    assert last.interval.low > 0.5


def test_a_claim_that_is_not_true_is_refuted():
    *_, last = converging(study(), Goal(within_s=0.5, share=0.5), Local())
    assert last.verdict == "does not hold"
    assert not last
    assert last.num_held == 0
    assert last.num_missions == 25


def test_too_few_missions_decide_nothing():
    *_, last = converging(study(episodes=30), Goal(within_s=5.0, share=0.97), Local())
    assert (last.verdict, last.num_missions) == ("not decided", 30)
    assert not last


def test_the_answer_does_not_depend_on_who_is_done_first():
    goal = Goal(within_s=5.0, share=0.5)
    *_, in_order = converging(study(), goal, Local())
    *_, out_of_order = converging(study(), goal, OutOfOrder())
    np.testing.assert_array_equal(in_order.window, out_of_order.window)
    assert in_order.report() == out_of_order.report()


def test_a_cost_of_one_s_own_settles_below_its_limit():
    """Speeds fall by a tenth a window from about 2.3 m/s, so they are below 1 from the ninth on."""
    parts = {"controller": Rest(SHORT)}
    batch = study(episodes=5, **parts).batches[0]
    window = fly_to_convergence(ConvergenceBatch(batch=batch, below=1.0))
    speed = [
        np.mean(np.linalg.norm(Swarm(SHORT, [seed]).states.velocity_mps[0], axis=1))
        for seed in batch.seeds
    ]
    expected = [math.floor(math.log(1.0 / each) / math.log(0.9)) + 1 for each in speed]
    np.testing.assert_array_equal(window, expected)

    *_, last = converging(
        study(**parts), Goal(within_s=2.0, share=0.8, below=1.0, unit="m/s"), Local()
    )
    assert last.verdict == "holds"
    assert last.cost == "mean speed below 1 m/s"


def test_what_is_printed_and_written_is_what_was_found():
    *_, last = converging(study(), Goal(within_s=5.0, share=0.5), Local())
    said = repr(last)
    assert f"{last.num_held} of {last.num_missions} missions" in said
    assert "claim:      at least 50.0% of missions within 5 s" in said
    assert said.endswith("verdict:    holds")
    assert max(map(len, said.splitlines())) <= 100
    told = last.report()
    assert told["missions"] == len(told["converged_window"]) == last.num_missions
    assert (told["found_share_low"], told["found_share_high"]) == last.interval
    assert told["config"]["policy"] == "tdma"
    never = int(np.sum(np.isnan(last.window)))
    assert told["converged_window"].count(None) == never


def test_a_time_that_is_a_whole_number_of_windows_is_in_time():
    """30 windows of 0.1 s are 3.0000000000000004 s to a computer."""
    *_, last = converging(study(episodes=25), Goal(within_s=3.0, share=0.5), Local())
    assert last.num_held == np.sum(last.window <= 30)
    assert np.sum(last.window == 30) > 0 or last.num_held == np.sum(last.seconds <= 3.0)


@pytest.mark.parametrize(
    ("mission", "goal", "components", "message"),
    [
        (SHORT, {"within_s": 7.0}, {}, "end at 6 s; fly at least 70 windows"),
        (paper("random-walk"), {}, {}, "random-walk has no cost, .* check flocking"),
        (paper("stationary"), {"below": 9.0}, {}, "and stationary has none"),
        (SHORT, {"within_s": 1.0}, {"controller": Rest(SHORT)}, r"mean speed \[m/s\], .* below"),
        (
            SHORT,
            {"within_s": 1.0, "below": 1.0, "unit": "m"},
            {"controller": Rest(SHORT)},
            "mean speed is in m/s, not m",
        ),
    ],
)
def test_what_cannot_converge_is_refused_before_the_flight(mission, goal, components, message):
    with pytest.raises(ValueError, match=message):
        next(converging(study(mission, **components), Goal(**goal), Local()))


@pytest.mark.parametrize(
    ("goal", "message"),
    [
        ({"share": 1.0}, "share must be a number from 0.001 to 0.999, not 1.0"),
        ({"within_s": 0.0}, "within must be a number"),
        ({"level": 0.3}, "level must be a number from 0.5"),
        ({"unit": "m"}, "unit m is that of below; give the number, too"),
    ],
)
def test_claims_out_of_range_are_refused(goal, message):
    with pytest.raises(ValueError, match=message):
        Goal(**goal)
