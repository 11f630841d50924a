import numpy as np
import pytest
from decentralised_reference import cut_off, transmitters
from learning_reference import LearnedApart, learner

from swarm_mj.mission import paper, reference
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.window import LocalViews
from swarm_mj.simulation.swarm import Swarm

NAME = "planner --payload none"
REST = paper("stationary", num_robots=10)


def only_plan(policy):
    """The plan that all robots of the first mission follow."""
    (flight,) = policy._teams[0]._flights.values()
    return flight.plan


@pytest.mark.parametrize("preset", [paper, reference])
@pytest.mark.parametrize("task", ["stationary", "random-walk", "flocking"])
def test_eq9_sharing_plans_is_planning_apart(preset, task):
    """Every robot decides as one that holds its own buffer alone, and plans from the beginning."""
    apart = LearnedApart(preset(task, num_robots=7), 3, learns=False)
    apart.fly(25)
    assert sum(len(mind.plans) for mind in apart.minds) == (7 if task == "stationary" else 0)


@pytest.mark.parametrize(("robot", "missing"), [(2, {"is_deaf": False}), (4, {"is_mute": False})])
def test_eq9_late_robots_join_the_plan_of_the_others(robot, missing):
    """A robot that nobody heard for 15 windows, or one that heard nobody, makes the same plan."""
    mission = paper("stationary", num_robots=6)
    channel = cut_off(mission, robot, range(15), **missing)
    apart = LearnedApart(mission, 1, channel=channel, learns=False)
    apart.fly(15)
    assert not np.all(apart.swarm.buffers.is_known)
    apart.fly(15)
    assert np.all(apart.swarm.buffers.is_known)
    plan = only_plan(apart.policy)
    for slot, transmit in enumerate(apart.fly(10), 60):
        if slot % 11 != 0:  # which is for turns
            np.testing.assert_array_equal(transmit, plan.transmits(slot))


@pytest.mark.parametrize("seed", range(3))
def test_a_team_at_rest_flies_one_plan_and_it_comes_true(seed):
    """T is what the plan expects, as soon as all that is older is replaced, and all know that."""
    swarm, policy = Swarm(REST, [seed]), make_policy("planner", REST)
    swarm.start(policy)
    flown = transmitters(swarm, policy, 60)
    plan = only_plan(policy)
    np.testing.assert_array_equal(flown[-40:, 0], [plan.transmits(h) for h in range(80, 120)])
    assert len(plan._transmits) == 120
    np.testing.assert_array_equal(swarm.buffers.timestamp[0], plan._timestamp / 2)


def mean_ages(mission, name, num_windows=80, **its):
    """Of two missions."""
    swarm, policy = Swarm(mission, [0, 1], **its), make_policy(name, mission)
    swarm.start(policy)
    return np.mean([swarm.step(policy).age_windows for _ in range(num_windows)], axis=0)


def decisions(position_m, velocity_mps, num_slots=20):
    """Who transmits by policy, slot by slot, in a team that has heard of everyone."""
    buffers = empty_buffers(1, len(position_m))
    buffers.timestamp[:] = 1.0
    buffers.position_m[0], buffers.velocity_mps[0] = position_m, velocity_mps
    policy = make_policy(NAME, REST)
    policy.start(len(position_m), [np.random.default_rng(0)])
    rows = []
    for slot in range(num_slots):
        views = LocalViews(buffers=buffers, now=np.array([slot / 2]), phases=())
        rows.append(policy.transmits(views)[0])
    return np.array(rows)


def test_eq9_whoever_believes_otherwise_plans_otherwise_and_nobody_else():
    """Robot 3 believes in other places, or that one robot moves: the other rows stay the same."""
    rng, others = np.random.default_rng(5), np.arange(10) != 3
    position_m = np.tile(rng.uniform(-300.0, 300.0, (10, 2)), (10, 1, 1))
    velocity_mps = np.zeros_like(position_m)
    before = decisions(position_m, velocity_mps)
    elsewhere_m, moving_mps = position_m.copy(), velocity_mps.copy()
    elsewhere_m[3], moving_mps[3, 7] = rng.uniform(-300.0, 300.0, (10, 2)), 0.1
    for after in (decisions(elsewhere_m, velocity_mps), decisions(position_m, moving_mps)):
        np.testing.assert_array_equal(after[:, others], before[:, others])
        assert np.any(after[:, 3] != before[:, 3])


def test_eq10_a_plan_from_buffers_is_younger_than_turns():
    """Of 12 robots at rest, over 80 windows: each of two missions."""
    mission = paper("stationary", num_robots=12, range_ratio=0.2)
    planned, *others = (mean_ages(mission, name) for name in (NAME, "spatial-tdma", "tdma"))
    assert np.all(planned < 0.85 * np.minimum(*others))


def test_a_new_start_forgets_and_the_clock_counts_from_there():
    """After 30 windows of another policy, all know all: the plan is flown from its first slot, but
    for slots that are for turns."""
    swarm, policy = Swarm(REST, [1]), make_policy(NAME, REST)
    tdma = make_policy("tdma", REST)
    swarm.start(tdma)
    transmitters(swarm, tdma, 30)
    flown = transmitters(swarm, policy, 10)
    plan = only_plan(policy)
    is_planned = np.arange(60, 80) % 9 != 0
    planned = np.array([plan.transmits(slot) for slot in range(20)])
    np.testing.assert_array_equal(flown[is_planned, 0], planned[is_planned])
    np.testing.assert_array_equal(np.sum(flown[~is_planned, 0], axis=1), 1)
    policy.start(10, [np.random.default_rng(0)])
    assert not policy._teams[0]._flights


def test_a_team_that_should_rest_but_moves_plans_as_teams_that_move():
    """Robots are pushed to and fro; the age is that of snapshots, not that of turns."""

    def push(buffers, states):
        own = np.arange(buffers.shape[1])
        assert states.velocity_mps.shape == buffers.velocity_mps[:, own, own].shape
        return np.where(buffers.velocity_mps[:, own, own] <= 0.0, 1.0, -1.0)

    mission = paper("stationary", num_robots=12, range_ratio=0.3)
    ages = [np.mean(mean_ages(mission, name, controller=push)) for name in ("planner", NAME)]
    assert ages[0] < 0.9 * ages[1]


@pytest.mark.parametrize(
    ("num_bytes", "num_robots", "payload"),
    [(10_623, 40, "links"), (10_622, 40, "none"), (140_000, 200, "links")],
)
def test_teams_at_rest_learn_if_slots_hold_it_to_the_byte(num_bytes, num_robots, payload):
    """Else they fly as without a payload. Of 200 robots, what is learned of links takes 117 kB or
    so, snapshots 164 kB: such a team learns without a plan for motion."""
    mission = paper("stationary", num_robots=num_robots, bit_rate=num_bytes * 160.0)
    policy = make_policy("planner", mission)
    assert policy.payload == payload
    if num_robots == 40:
        assert policy.packet(mission).num_bytes == (10_623 if payload == "links" else 367)


CHANNELS = {
    "free space": {},
    "shadowing": {"shadowing_db": 6.0},
    "rayleigh": {"fading": "rayleigh"},
    "erasures": {"erasure": 0.3},
    "all of them": {"shadowing_db": 6.0, "fading": "rayleigh", "erasure": 0.2},
}


def flown(mission, policy, seeds, num_windows=60):
    return transmitters(Swarm(mission, seeds), policy, num_windows)


@pytest.mark.parametrize("channel", CHANNELS)
@pytest.mark.parametrize(("seed", "num_robots"), [(0, 6), (1, 7)])
def test_eq9_sharing_is_learning_apart(channel, seed, num_robots):
    """Every robot decides as one that holds what packets told it, and nothing else."""
    mission = paper("stationary", num_robots=num_robots, **CHANNELS[channel])
    apart = LearnedApart(mission, seed)
    apart.fly(60)
    plans = {key for mind in apart.minds for key in mind.plans}
    assert None in plans  # all begin with what they believe
    assert (len(plans) > 1) == (channel != "free space")


def test_a_robot_that_missed_the_best_table_flies_by_the_best_it_has():
    """Robot 3 decodes nothing while tables spread: it flies by its own, and by one of the others'
    as soon as it hears them again. Throughout it decides as one that holds its packets alone."""
    mission, num_calls = paper("stationary", num_robots=6, shadowing_db=6.0), 0
    radio = Swarm(mission, [0]).channel

    class Deaf:
        def __call__(self, position_m, recipient):
            nonlocal num_calls
            num_calls += 1
            heard = radio.at(np.array([num_calls - 1]), np.arange(1))(position_m, recipient)
            if 32 < num_calls <= 44:
                heard[0, 3] = 3
            return heard

    apart = LearnedApart(mission, 0, channel=Deaf())
    apart.fly(21)
    owners = [mind.flown.rank[1] for mind in apart.minds]
    assert owners[3] == 3
    assert 3 not in owners[:3] + owners[4:]
    apart.fly(6)
    assert apart.minds[3].took_over >= 1
    assert apart.minds[3].flown.rank[1] in owners[:3] + owners[4:]


def test_the_same_seed_is_the_same_flight_whatever_flies_beside():
    mission = paper("stationary", num_robots=6, shadowing_db=6.0, erasure=0.1)
    beside = flown(mission, learner(mission), [5, 3], 36)
    np.testing.assert_array_equal(beside, flown(mission, learner(mission), [5, 3], 36))
    alone = flown(mission, learner(mission), [3], 36)
    np.testing.assert_array_equal(alone[:, 0], beside[:, 1])
    assert np.any(beside[:, 0] != beside[:, 1])


def test_eq10_learning_pays_under_shadowing():
    """Four missions of 80 windows, of which the second half counts: 2.7 windows instead of 4.0."""
    mission, age = paper("stationary", num_robots=12, shadowing_db=6.0), {}
    for name, policy in (
        ("learns", learner(mission)),
        ("does not", make_policy("planner --payload none", mission)),
    ):
        swarm = Swarm(mission, range(4))
        windows = [swarm.step(policy).age_windows for _ in range(80)]
        age[name] = np.mean(windows[40:], axis=0)
    assert np.all(age["learns"] < age["does not"])
    assert np.mean(age["learns"]) < 0.85 * np.mean(age["does not"])


@pytest.mark.parametrize("task", ["stationary", "random-walk", "flocking"])
@pytest.mark.parametrize("num_robots", [2, 3, 6])
def test_tiny_teams_take_turns_and_send_the_paper_s_packets(task, num_robots):
    mission = paper(task, num_robots=num_robots)
    for name in ("planner", NAME):
        policy = make_policy(name, mission)
        assert policy.payload == "none"
        np.testing.assert_array_equal(
            flown(mission, policy, [4, 5], 40),
            flown(mission, make_policy("tdma", mission), [4, 5], 40),
        )


@pytest.mark.parametrize(
    ("num_robots", "channel", "seed"),
    [
        (8, {"shadowing_db": 6.0}, 910_002),
        (8, {"position_noise_m": 20.0}, 910_006),
        (7, {"arena": "rooms"}, 910_001),
    ],
)
def test_a_plan_on_links_that_do_not_work_starves_nobody(num_robots, channel, seed):
    """The oldest news is of some rounds of turns; it was of 100 windows and more by plans alone."""
    mission = paper("stationary", num_robots=num_robots, num_windows=200, **channel)
    swarm = Swarm(mission, [seed])
    policy = make_policy("planner", mission)
    oldest = 0.0
    for window in range(200):
        swarm.step(policy)
        if window >= 50:
            oldest = max(oldest, np.max(swarm.now[0] - swarm.buffers.timestamp[0]))
    assert oldest < 8.0 * num_robots
