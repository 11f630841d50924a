import itertools
from functools import partial

import mujoco
import numpy as np
import pytest
from channels import to_nobody

from swarm_mj.mission import paper, reference
from swarm_mj.mission.placement import largest_part
from swarm_mj.policies.policy import BroadcastPolicy, CentralisedPolicy, DecentralisedPolicy
from swarm_mj.policies.random_access import RandomFlooding
from swarm_mj.policies.registry import POLICIES, make_policy
from swarm_mj.simulation.swarm import Swarm

TASKS = ["stationary", "random-walk", "flocking"]
PRESETS = [paper, reference]
MODES = ["exact", "contact"]
NUM_WINDOWS = 8

# Every policy under both presets and physics and in all tasks; every kind of mission with several.
everything = pytest.mark.parametrize(
    ("name", "task", "preset", "physics"),
    [
        (name, TASKS[(place + kind) % 3], preset, physics)
        for place, name in enumerate(POLICIES)
        for kind, (preset, physics) in enumerate(itertools.product(PRESETS, MODES))
    ],
)


def small(task="flocking", preset=paper, **numbers):
    return preset(task, num_robots=8, velocity_ratio=1.0, **numbers)


def course(swarm, policy, num_windows=NUM_WINDOWS):
    """Everything that can be seen of a mission: arrays with the missions as leading axis."""
    swarm.start(policy)
    seen = []
    for _ in range(num_windows):
        costs = swarm.step(policy)
        seen += [swarm.states.position_m, swarm.states.velocity_mps, swarm.now]
        seen += [array.copy() for array in vars(swarm.buffers).values()]
        seen += [array for phase in swarm.phases for array in phase]
        seen += [costs.age_windows, costs.is_complete, costs.velocity_variance_m2ps2]
        seen += list(costs.packets)
    return seen


def assert_same(one, other):
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)


@everything
def test_a_mission_depends_on_its_seed_alone(name, task, preset, physics):
    """Bit by bit: in a batch or alone, in a new swarm or in a restarted one."""
    mission = small(task, preset, physics=physics)
    together = course(Swarm(mission, [5, 6, 7]), make_policy(name, mission))
    swarm = Swarm(mission, [6])
    alone = course(swarm, make_policy(name, mission))
    assert_same([array[1:2] for array in together], alone)
    swarm.restart([7])
    restarted = course(swarm, make_policy(name, mission))
    assert_same([array[2:3] for array in together], restarted)
    assert not np.array_equal(alone[0], restarted[0])


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("physics", MODES)
def test_every_policy_meets_the_same_missions(preset, physics):
    """Common random numbers: equal seeds are equal placements, and equal walks.

    Under flooding the reference preset's robots move twice per window, so its states are every
    second one of the others'.
    """
    mission, first = small("random-walk", preset, physics=physics), {}
    for name in POLICIES:
        swarm = Swarm(mission, [1, 2])
        swarm.start(make_policy(name, mission))
        moves = 2 if mission.moves_each_transmission and name == "random-flooding" else 1
        for move in range(0, 12, moves):
            expected = first.setdefault(move, swarm.states.position_m)
            np.testing.assert_array_equal(swarm.states.position_m, expected)
            swarm.step()
    assert len(first) == 12


class Silent(DecentralisedPolicy):
    """Nobody ever transmits."""

    def start(self, num_robots, rngs):  # noqa: ARG002 - a Policy
        self.rngs = rngs

    def recipients(self, views):
        return views.silence.copy()


def test_iv_b_start_is_connected_inside_and_known_to_nobody_else():
    mission = small("random-walk")
    swarm = Swarm(mission, list(range(10)))
    for position_m in swarm.states.position_m:
        assert largest_part(position_m, 250.0).all()
        assert np.abs(position_m).max() <= 500.0 * (8 / 40) ** 0.5
    buffers, own = swarm.buffers, np.arange(8)
    np.testing.assert_array_equal(buffers.position_m[:, own, own], swarm.states.position_m)
    np.testing.assert_array_equal(buffers.velocity_mps[:, own, own], swarm.states.velocity_mps)
    is_other = ~np.eye(8, dtype=bool)
    assert not np.any(buffers.position_m[:, is_other])
    assert not np.any(buffers.is_known[:, is_other])
    np.testing.assert_array_equal(swarm.now, 0.0)
    assert swarm.phases == ()


def test_start_is_known_to_everyone_where_the_mission_grants_it():
    mission = small("random-walk", prior_knowledge="start")
    swarm = Swarm(mission, [3, 4])
    assert np.all(swarm.buffers.is_known)
    for i in range(8):
        np.testing.assert_array_equal(swarm.buffers.position_m[:, i], swarm.states.position_m)
        np.testing.assert_array_equal(swarm.buffers.velocity_mps[:, i], swarm.states.velocity_mps)
    costs = swarm.step(Silent())
    assert costs.is_complete.all()
    assert costs.age_windows.tolist() == [1.0 - 1.0 / 8.0] * 2  # all but oneself is from t = 0


class Witness(CentralisedPolicy):
    """Notes what it is shown, and what the robots know of themselves by then; stays silent."""

    def __init__(self):
        self.shown = []

    def recipients(self, views, states):
        own = np.arange(views.num_robots)
        self.shown.append((states.position_m, views.buffers.position_m[:, own, own], views.now))
        return views.silence.copy()


@pytest.mark.parametrize("preset", PRESETS)
def test_policy_decides_before_the_robots_move(preset):
    """In window w it sees the states at the end of window w - 1, and so do the robots."""
    swarm, witness = Swarm(small("random-walk", preset), [1, 2]), Witness()
    swarm.start(witness)
    ends_m = [swarm.states.position_m]
    for window in range(5):
        swarm.step(witness)
        shown_m, believed_m, now = witness.shown[window]
        np.testing.assert_array_equal(shown_m, ends_m[window])
        np.testing.assert_array_equal(believed_m, ends_m[window])
        np.testing.assert_array_equal(now, window)
        ends_m.append(swarm.states.position_m)
        assert np.all(ends_m[window] != ends_m[window + 1])
    own = np.arange(8)
    np.testing.assert_array_equal(swarm.buffers.position_m[:, own, own], ends_m[-1])


SilentTwice = partial(RandomFlooding, 0.0)  # nobody ever transmits, twice per window


def silence_of(num_missions, num_robots):
    return np.tile(np.arange(num_robots), (num_missions, 1))


def test_alg1_exchange_by_hand():
    """Robot 0 addresses robot 1, alone on the air and within range: both learn of each other.

    The packet leaves at half a window, the answer at a whole one, after the robots moved.
    """
    mission = small("random-walk", range_ratio=10.0)
    swarm = Swarm(mission, [1])
    recipient = silence_of(1, 8)
    recipient[0, 0] = 1
    costs = swarm.step_with_recipients(recipient)
    timestamp = np.diag(np.full(8, 1.0))
    timestamp[1:, 0] = 0.5  # everyone decoded robot 0's packet,
    timestamp[[0, *range(2, 8)], 1] = 1.0  # and robot 1's answer
    np.testing.assert_array_equal(swarm.buffers.timestamp[0], timestamp)
    np.testing.assert_array_equal(swarm.buffers.position_m[0, 0, 1], swarm.states.position_m[0, 1])
    assert swarm.buffers.last_attempt[0, 0, 1] == 0.5
    assert np.count_nonzero(swarm.buffers.last_attempt) == 1
    assert costs.packets.attempted == costs.packets.delivered == costs.packets.answered == 1
    assert costs.packets.overheard == 6 + 6
    assert costs.age_windows[0] == pytest.approx(1.0 - timestamp.mean())


@pytest.mark.parametrize(("preset", "own_attempt"), [(paper, 0.0), (reference, 0.5)])
def test_eq7_silence_is_an_attempt_in_the_reference_preset_only(preset, own_attempt):
    swarm = Swarm(small(preset=preset), [1])
    swarm.step_with_recipients(silence_of(1, 8))
    np.testing.assert_array_equal(swarm.buffers.last_attempt[0], np.eye(8) * own_attempt)
    swarm.step(SilentTwice())
    expected = np.eye(8) * (2.0 if own_attempt else 0.0)
    np.testing.assert_array_equal(swarm.buffers.last_attempt[0], expected)


def test_eq6_channel_is_exchangeable():
    """Everyone decodes robot 5 and nobody else, wherever they are: the swarm believes it."""

    def only_robot_5(position_m, recipient):
        assert position_m.shape == (*recipient.shape, 2)
        return np.where(recipient[:, 5:6] != 5, 5, np.arange(8))

    swarm = Swarm(small(), [1, 2], channel=only_robot_5)
    swarm.step_with_recipients(np.roll(silence_of(2, 8), 1, axis=1))
    assert np.all(swarm.buffers.timestamp[:, np.arange(8) != 5, 5] == 0.5)
    is_own_or_5 = np.eye(8, dtype=bool) | (np.arange(8) == 5)
    np.testing.assert_array_equal(swarm.buffers.is_known, np.stack([is_own_or_5] * 2))


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize(
    ("name", "task"), [*((name, "random-walk") for name in POLICIES), ("mst", "flocking")]
)
def test_eq5_eq8_news_needs_a_packet_and_was_true_when_observed(name, task, preset):
    """T never falls, and rises with a packet only; M^{i,j} is j's true state at T^{i,j}."""
    mission = small(task, preset)
    swarm, policy = Swarm(mission, [1, 2]), make_policy(name, mission)
    swarm.start(policy)
    path = [swarm.states]
    is_other = ~np.eye(8, dtype=bool)
    num_learnt = num_deaf = 0
    for _ in range(60):
        before = swarm.buffers.timestamp.copy()
        swarm.step()
        path.append(swarm.states)
        timestamp = swarm.buffers.timestamp
        assert np.all((before <= timestamp) & (timestamp <= swarm.now[:, None, None]))
        np.testing.assert_array_equal(timestamp[:, ~is_other], swarm.now[:, None].repeat(8, axis=1))
        has_decoded = np.any([p.heard != silence_of(2, 8) for p in swarm.phases], axis=0)
        has_news = np.any((timestamp > before) & is_other, axis=2)
        assert not np.any(has_news & ~has_decoded)
        num_learnt += np.sum(has_news)
        num_deaf += np.sum(~has_decoded)
    assert num_learnt > 20
    assert num_deaf > 0
    if mission.moves_each_transmission:  # then states change within a window, too
        return
    observed_in = np.ceil(swarm.buffers.timestamp).astype(int)  # both phases of window w end it
    for b, i, j in zip(*np.nonzero(swarm.buffers.is_known), strict=True):
        then = path[observed_in[b, i, j]]
        np.testing.assert_array_equal(swarm.buffers.position_m[b, i, j], then.position_m[b, j])
        np.testing.assert_array_equal(swarm.buffers.velocity_mps[b, i, j], then.velocity_mps[b, j])


class Watchful(BroadcastPolicy):
    """Everyone transmits, and keeps what it saw of its own age and of the last phases."""

    def __init__(self):
        self.own_age, self.num_phases = [], []

    def transmits(self, views):
        robots = np.arange(views.num_robots)
        self.own_age.append(views.now[:, None] - views.buffers.timestamp[:, robots, robots])
        self.num_phases.append(len(views.phases))
        return np.ones_like(views.silence, dtype=bool)


def test_the_clock_and_the_last_phase_are_current_at_each_half_of_flooding():
    policy = Watchful()
    swarm = Swarm(paper("random-walk", num_robots=5, range_ratio=1.0), [1])
    for _ in range(3):
        swarm.step(policy)
    np.testing.assert_array_equal(policy.own_age, 0.0)
    assert policy.num_phases == [0, 1, 2, 1, 2, 1]


class Rotates(CentralisedPolicy):
    """Everyone addresses the robot before it; writes into all that it gets, if it meddles."""

    def __init__(self, *, meddles):
        self.meddles = meddles

    def recipients(self, views, states):
        if self.meddles:
            views.now[:] = 1000.0
            for phase in views.phases:
                phase.heard[:] = 0
            spoil(states)
        return np.roll(views.silence, 1, axis=1)


def spoil(states):
    states.position_m[:] = states.velocity_mps[:] = 7.0
    if states.is_active is not None:
        states.is_active[:] = True


class Pulls:
    cost_name, cost_unit = "nothing", "m"

    def __init__(self, *, meddles):
        self.meddles = meddles

    def __call__(self, _buffers, states):
        wanted = -states.position_m
        self.cost(states)
        return wanted

    def cost(self, states):
        if self.meddles:
            spoil(states)
        return np.zeros(len(states.position_m))


def hears_nothing_and_writes(position_m, recipient):
    position_m[:] = 0.0
    return to_nobody(position_m, recipient)


def test_users_components_cannot_move_what_they_are_shown():
    mission, courses = small(failure_fraction=0.3, num_windows=NUM_WINDOWS), []
    for meddles, channel in ((False, to_nobody), (True, hears_nothing_and_writes)):
        swarm = Swarm(mission, [1, 2], channel=channel, controller=Pulls(meddles=meddles))
        courses.append(course(swarm, Rotates(meddles=meddles)))
    assert_same(*courses)


@pytest.mark.parametrize(
    ("answer", "complaint"),
    [
        (np.ones((1, 8)), r"transmits of Says must be True or False .* \(1, 8\), .* not float64"),
        (np.ones(8, dtype=bool), r"transmits of Says must .* not bool of shape \(8,\)"),
        (-1, r"transmits of Says must .* not int64 of shape \(\)"),
    ],
)
def test_who_transmits_is_told_by_one_truth_value_a_robot(answer, complaint):
    class Says(BroadcastPolicy):
        def transmits(self, _views):
            return answer

    with pytest.raises(ValueError, match=complaint):
        Swarm(small(), [1]).step(Says())


@pytest.mark.parametrize("value", [[-1.0, 0.0], [np.nan, 0.0], [0.0], [[0.0, 0.0]]])
def test_a_cost_is_one_number_of_0_or_more_for_each_mission(value):
    class Wrong:
        cost_name, cost_unit = "nothing", "m"

        def __call__(self, _buffers, states):
            return np.zeros_like(states.velocity_mps)

        def cost(self, _states):
            return np.array(value)

    swarm = Swarm(paper("stationary", num_robots=3, range_ratio=10.0), [1, 2], controller=Wrong())
    with pytest.raises(ValueError, match=r"cost must have shape \(2,\), one number of 0 or more"):
        swarm.step(make_policy("tdma", swarm.mission))


def test_a_cost_needs_a_name_and_a_unit():
    class Nameless:
        __call__ = cost = lambda _self, *_: None

    with pytest.raises(TypeError, match="set its cost_name and cost_unit"):
        Swarm(paper(num_robots=3), [1], controller=Nameless())


def test_a_scene_that_mujoco_does_not_take_is_told_in_one_line():
    def flat(spec, _mission):
        spec.worldbody.add_geom(name="wall", type=mujoco.mjtGeom.mjGEOM_BOX, size=[1, 1, 0])

    with pytest.raises(ValueError, match=r"the scene does not compile: .*size 2 .*wall") as told:
        Swarm(paper(num_robots=3), [1], scene=flat)
    assert "\n" not in str(told.value)


def test_robots_that_collide_start_apart():
    """40 robots on 63 m by 63 m: of teams drawn at random, nearly half have two that overlap."""
    mission = paper("random-walk", collide=True, density_per_km2=10_000.0)
    for position_m in Swarm(mission, range(20)).states.position_m:
        apart_m = np.linalg.norm(position_m[:, None] - position_m, axis=-1)
        assert np.min(apart_m[np.triu_indices(40, 1)]) >= 1.0


class Told(Silent):
    """Notes what it is told of the channel, and whether it had begun."""

    def inform(self, belief):
        self.told, self.had_begun = belief, hasattr(self, "rngs")


class ToldTheTruth(Witness):
    def inform(self, truth):
        self.told = truth


def wall_across(spec, mission):
    """An obstacle of the user's own."""
    half_m = mission.half_side_m
    spec.worldbody.add_geom(type=6, pos=[0, 0, 5], size=[1, half_m / 2, 5], group=1)


@pytest.mark.parametrize(("known", "has_law"), [("nothing", False), ("map", True)])
def test_policies_are_told_of_the_channel_by_their_kind_before_they_start(known, has_law):
    """The scene's own wall is on the map."""
    mission = small("stationary", prior_knowledge=known, physics="contact")
    swarm, robots, centre = Swarm(mission, [1], scene=wall_across), Told(), ToldTheTruth()
    swarm.step(robots)
    assert robots.told is swarm.belief
    assert (robots.told.law is not None) == has_law
    assert not robots.had_begun
    swarm.step(centre)
    assert centre.told.channel is swarm.channel


def test_a_policy_must_be_started_first():
    with pytest.raises(ValueError, match=r"start one: swarm.start\(policy\)"):
        Swarm(small(), [1]).step()
