import copy

import numpy as np
import pytest
from channels import to_nobody, unreliable
from minds import Flight, converse, cut_off, minds_of, rows, thinks_alike

from swarm_mj.mission import paper, reference
from swarm_mj.policies import make_policy
from swarm_mj.swarm import Swarm

PLANNERS = ["planner", "planner-lone"]
DISCOVERY = 30  # windows, for teams of up to 20 robots


@pytest.mark.parametrize("name", PLANNERS)
@pytest.mark.parametrize("preset", [paper, reference])
@pytest.mark.parametrize("task", ["stationary", "random-walk", "flocking"])
def test_eq9_sharing_plans_is_planning_apart(name, preset, task):
    """Every robot decides as one that holds its own buffer and the packets it decoded, alone."""
    for seed, num_robots in enumerate((6, 9)):
        thinks_alike(preset(task, num_robots=num_robots, range_ratio=0.2), seed, name, 65)


@pytest.mark.parametrize("name", PLANNERS)
def test_eq9_sharing_is_planning_apart_where_pictures_differ(name):
    """Sparse teams are not complete after the discovery, and pictures spread late; robots that
    fly fast fall apart; packets come at random, or one robot takes part in some windows only."""
    sparse = paper("stationary", num_robots=20, range_ratio=0.2)
    fast = paper("random-walk", num_robots=9, velocity_ratio=1.0)
    small = paper("stationary", num_robots=7)
    num_taken = [
        thinks_alike(sparse, 0, name, 120)[1],
        thinks_alike(sparse, 3, name, 120)[1],
        thinks_alike(fast, 1, name, 90)[1],
        thinks_alike(small, 2, name, 90, unreliable(4, senders_listen=False))[1],
        thinks_alike(small, 5, name, 90, cut_off(small, 2, range(15, 45)))[1],
        thinks_alike(small, 6, name, 90, cut_off(small, 4, range(70), is_deaf=False))[1],
    ]
    assert name == "planner-lone" or sum(count > 0 for count in num_taken) >= 3


def sequence_of_views(flight, num_windows):
    """What all robots know before each of the next windows; none has heard any packet."""
    views = []
    for _ in flight.windows(num_windows):
        views.append(copy.deepcopy(flight.swarm.views))
        for phase in views[-1].phases:
            phase.heard[:] = np.arange(phase.heard.shape[1])
    return views


def with_row_of(mine, theirs, row):
    """Their views, in which the one robot knows what mine does."""
    mixed = copy.deepcopy(theirs)
    pairs = [(mine.buffers, mixed.buffers), *zip(mine.phases, mixed.phases, strict=True)]
    for own, other in pairs:
        for name, array in vars(own).items():
            vars(other)[name][:, row] = array[:, row]
    return mixed


def in_other_company(policy, stranger, row):
    """The policy, in which all that the one robot cannot know is a stranger's.

    It knows its own memory, and the two pictures that it holds with the plans that lead to and
    follow from them.
    """
    mixed, team = copy.deepcopy(stranger), policy._teams[0]
    other = mixed._teams[0]
    mine, best = int(team._holds[row]), int(team._will_hold[row])
    for pictures, whose, kept in (("_current", mine, mine), ("_upcoming", best, best)):
        for name in ("is_known", "position_m", "spread_m"):
            array = getattr(getattr(other, pictures), name)
            array[kept] = getattr(getattr(team, pictures), name)[whose]
    for name in ("_directly", "_holds", "_will_hold"):
        getattr(other, name)[row] = getattr(team, name)[row]
    other._continues = other._continues.copy()
    other._continues[best] = team._continues[best]
    for key in {mine, int(team._continues[best])}:
        other._plans[key] = copy.deepcopy(team._plans[key])
    return mixed


def decisions(policy, all_views):
    return np.array([policy.recipients(views)[0] for views in all_views])


@pytest.mark.parametrize("task", ["random-walk", "flocking"])
def test_eq9_a_planner_s_robot_decides_on_its_own_memory(task):
    """For 15 windows, into the next epoch, in which it hears nothing new."""
    mission = paper(task, num_robots=8)
    mine, theirs = (Flight.of(mission, seed) for seed in (1, 2))
    theirs.team._order[:] = mine.team._order  # common before the mission
    for flight in (mine, theirs):
        assert len(list(flight.windows(54))) == 54
    policy, stranger = copy.deepcopy((mine.policy, theirs.policy))
    own_views, other_views = sequence_of_views(mine, 15), sequence_of_views(theirs, 15)
    alone = decisions(copy.deepcopy(policy), own_views)
    is_sent = np.any(alone != np.arange(8), axis=0)
    assert np.sum(is_sent) >= 4
    for row in range(8):
        mixed = [with_row_of(*pair, row) for pair in zip(own_views, other_views, strict=True)]
        in_company = decisions(in_other_company(policy, stranger, row), mixed)
        assert in_company[:, row].tolist() == alone[:, row].tolist()
        assert np.any(in_company != alone)


def late_views(seeds):
    """What two teams know in windows 0, 3, ..., 63 of a flight of their own."""
    swarm = Swarm(paper("flocking", num_robots=8), seeds)
    talk = make_policy("random-flooding", swarm.mission, 0.2)
    views = []
    for window in range(64):
        if window % 3 == 0:
            views.append(copy.deepcopy(swarm.views))
        swarm.step(talk)
    return views


def test_eq9_the_lone_planner_decides_on_its_own_view_beyond_the_discovery():
    """Its packets carry T, M and P alone, so all that a robot knows is in its view."""
    mission, row = paper("flocking", num_robots=8), 5
    mine, theirs = late_views([1, 2]), late_views([3, 4])
    decided = []
    for company in (mine, theirs):
        policy = make_policy("planner-lone", mission)
        policy.start(8, [np.random.default_rng((9, b)) for b in range(2)])
        mixed = [with_row_of(*pair, row) for pair in zip(mine, company, strict=True)]
        decided.append(np.array([policy.recipients(views) for views in mixed]))
    assert np.any(decided[0][DISCOVERY // 3 :, :, row] != row)
    assert np.any(decided[0] != decided[1])
    np.testing.assert_array_equal(decided[0][:, :, row], decided[1][:, :, row])


def test_packets_carry_pictures_unless_told_otherwise():
    mission = paper("stationary", num_robots=5)
    assert make_policy("planner", mission).carries_payload
    assert not make_policy("planner-lone", mission).carries_payload
    assert not make_policy("planner", mission).transmits_twice


@pytest.mark.parametrize("name", PLANNERS)
@pytest.mark.parametrize(("num_robots", "num_windows"), [(2, 30), (8, 30), (24, 36)])
def test_one_robot_at_a_time_speaks_in_the_discovery(name, num_robots, num_windows):
    """In the order drawn from the mission's numbers, to whichever it has not heard for longest."""
    mission = paper("stationary", num_robots=num_robots)
    flight = Flight.of(mission, 4, name)
    rng = np.random.SeedSequence(4).spawn(3)[2]
    order = np.random.default_rng(rng).permutation(num_robots).tolist()
    last_heard = [{} for _ in range(num_robots)]
    for now, recipient in flight.windows(num_windows):
        for phase in flight.swarm.phases:
            for j, i in enumerate(phase.heard[0].tolist()):
                if i != j:
                    last_heard[j][i] = now
        speaker = order[now % num_robots]
        expected = list(range(num_robots))
        known = last_heard[speaker]
        anyone = order[(now + 1) % num_robots]
        expected[speaker] = min(sorted(known), key=known.__getitem__) if known else anyone
        assert recipient.tolist() == expected
    assert not flight.team._plans
    flight.swarm.decide(flight.policy)
    assert flight.team._plans


def is_complete(flight):
    """Whether every robot flies by one picture, which has all robots."""
    held = np.unique(flight.team._holds)
    return len(held) == 1 and flight.team._plans[int(held[0])].is_complete


@pytest.mark.parametrize("robot", [0, 5])
def test_a_robot_unheard_in_the_discovery_is_found_later(robot):
    """Nobody knew it when the first schedules were made; in the end all fly by one plan with it."""
    mission = paper("stationary", num_robots=8)
    flight = Flight.of(mission, 3, channel=cut_off(mission, robot, range(45)))
    others = np.delete(np.arange(8), robot)
    for now, _ in flight.windows(150):
        if DISCOVERY < now <= 45:
            assert not np.any(flight.swarm.buffers.is_known[0, others, robot])
            assert not is_complete(flight)
    assert np.all(flight.swarm.buffers.is_known)
    assert is_complete(flight)
    assert_flies_as_planned(flight, 3)


def assert_flies_as_planned(flight, num_epochs):
    """From an epoch's beginning on all do as one plan says, and it comes true."""
    for _ in range(num_epochs):
        for now, recipient in flight.windows(10):
            (whose,) = np.unique(flight.team._holds).tolist()
            plan = flight.team._plans[whose]
            assert plan.is_complete
            np.testing.assert_array_equal(recipient, plan.recipient[now % 10])
        np.testing.assert_array_equal(flight.swarm.buffers.timestamp[0], plan.timestamp)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("preset", [paper, reference])
def test_a_connected_team_at_rest_flies_one_plan_to_the_letter(preset, seed):
    """After the discovery all 10 robots hold one picture, positions are true, and no packet that
    was counted on is lost: T is what the plan expects, as soon as all that is older is replaced."""
    flight = Flight.of(preset("stationary", num_robots=10), seed)
    assert len(list(flight.windows(DISCOVERY))) == DISCOVERY
    assert_flies_as_planned(flight, 4)


def test_discovery_goes_on_every_fourth_window_while_a_robot_is_missing():
    """Robot 2 takes no part at all: its teammates call on, in order, and so does it."""
    mission = paper("stationary", num_robots=6)
    flight = Flight.of(mission, 1, channel=cut_off(mission, 2, range(200)))
    order = flight.team._order.tolist()
    speakers = []
    for now, recipient in flight.windows(100):
        sent = np.flatnonzero(recipient != np.arange(6)).tolist()
        if now >= DISCOVERY and now % 4 == 0:
            assert sent == [order[now // 4 % 6]]
            speakers += sent
        if now >= DISCOVERY and now % 4 != 0:
            assert 2 not in sent
    assert set(speakers) == set(range(6))


def test_who_misses_the_best_picture_flies_by_the_best_it_has():
    """A robot that is deaf from the last epoch of the discovery on plans by its own picture, which
    is another one than its teammates', and speaks when that says so."""
    mission = paper("random-walk", num_robots=8)
    deaf = 6
    channel = cut_off(mission, deaf, range(DISCOVERY - 10, 200), is_mute=False)
    flight = Flight.of(mission, 2, channel=channel)
    minds, num_sent = minds_of(flight, mission), 0
    for now, recipient in flight.windows(70):
        for phase in flight.swarm.phases:
            converse(minds, phase.heard[0].tolist(), float(now))
        decided = [mind.decide(rows(flight.swarm.buffers, mind.me), float(now)) for mind in minds]
        assert decided == recipient.tolist()
        if now >= DISCOVERY + 10:
            assert minds[deaf].current.goodness[2] == deaf
            assert all(mind.current.goodness[2] != deaf for mind in minds if mind.me != deaf)
            num_sent += recipient[deaf] != deaf
    assert num_sent >= 3


@pytest.mark.parametrize("name", PLANNERS)
@pytest.mark.parametrize("num_robots", [2, 5])
def test_robots_that_never_met_do_not_fall_silent(name, num_robots):
    """In every round of the discovery, thinned out, everyone calls somebody else."""
    mission = paper("stationary", num_robots=num_robots)
    flight = Flight.of(mission, 7, name, to_nobody)
    calls = np.array([row for _, row in flight.windows(DISCOVERY + 10 * 4 * num_robots)])
    is_sent = calls != np.arange(num_robots)
    rounds = is_sent[DISCOVERY:].reshape(10, 4 * num_robots, num_robots)
    assert np.all(np.sum(rounds, axis=1) == 1)


@pytest.mark.parametrize("name", PLANNERS)
def test_a_mission_does_not_depend_on_its_neighbours(name):
    mission = paper("random-walk", num_robots=8)
    three, alone = Swarm(mission, [5, 6, 7]), Swarm(mission, [6])
    together, apart = make_policy(name, mission), make_policy(name, mission)
    for _ in range(60):
        three.step(together)
        alone.step(apart)
        np.testing.assert_array_equal(three.phases[0].recipient[1:2], alone.phases[0].recipient)


@pytest.mark.parametrize("name", PLANNERS)
def test_a_new_start_forgets_and_the_same_seed_is_the_same_flight(name):
    mission = paper("random-walk", num_robots=8)
    policy, flights = make_policy(name, mission), []
    for seed in (3, 4, 3):
        flight = Flight(swarm=Swarm(mission, [seed]), policy=policy)
        flight.swarm.start(policy)
        flights.append([row.tolist() for _, row in flight.windows(55)])
    assert flights[0] == flights[2] != flights[1]
