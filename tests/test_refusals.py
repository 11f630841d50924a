"""What library users may pass by mistake: refused with the value and the way out, never a crash.

Compiled loops do not check their indices, so a wrong shape would end the process.
"""

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.physics.worlds import PointWorlds
from swarm_mj.policies.policy import Policy
from swarm_mj.policies.random_access import RandomFlooding
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.costs import mean_hops
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm


def small(**overrides):
    return paper("random-walk", **({"num_robots": 5, "num_windows": 5} | overrides))


SHAPE = r"recipient must have shape \(2, 5\)"
NO_ROBOT = "of robot 2 in mission 1 must be from 0 to 4, not "


@pytest.mark.parametrize(
    ("recipient", "complaint"),
    [
        *((np.zeros(shape, int), SHAPE) for shape in [(1, 5), (2, 50), (2, 4), (3, 5)]),
        *(([[0, 1, 2, 3, 4], [0, 1, i, 3, 4]], f"{NO_ROBOT}{i}") for i in (-1, 5, 10**8)),
    ],
)
def test_recipients_that_are_no_robots_are_refused_before_anyone_moves(recipient, complaint):
    swarm = Swarm(small(), [1, 2])
    before = swarm.states.position_m.copy()
    with pytest.raises(ValueError, match=complaint):
        swarm.step_with_recipients(np.array(recipient))
    np.testing.assert_array_equal(swarm.states.position_m, before)


@pytest.mark.parametrize("robot", [-2, 5, 10**8])
def test_addressees_that_do_not_exist_are_refused(robot, monkeypatch):
    """Of a broadcast, too, for which -1 stands for everyone."""
    recipient = np.array([[-1, 1, robot, 3, 4]])
    monkeypatch.setattr(RandomFlooding, "recipients", lambda _self, _views: recipient)
    with pytest.raises(ValueError, match=f"robot 2 in mission 0 must be from 0 to 4, not {robot}"):
        Swarm(small(), [1]).step(RandomFlooding(0.5))


@pytest.mark.parametrize("physics", ["exact", "contact"])
def test_accelerations_must_be_one_vector_per_robot(physics):
    worlds = PointWorlds(small(physics=physics), 2)
    with pytest.raises(ValueError, match=r"acceleration must have shape \(2, 5, 2\)"):
        worlds.step(np.zeros((1, 5, 2)))


@pytest.mark.parametrize("parent", [-1, 0])
def test_parents_that_form_no_tree_have_no_hops(parent):
    """Parents that lead nowhere, and robot 0 as its own ancestor in robot 1's buffer."""
    buffers = empty_buffers(1, 3)
    buffers.timestamp[:] = 1.0
    buffers.parent[:] = parent
    with pytest.raises(ValueError, match="must lead back"):
        mean_hops(buffers)


@pytest.mark.parametrize("seeds", [[], [1], [1, 2, 3], [1, -2]])
def test_restart_needs_a_seed_per_mission(seeds):
    swarm = Swarm(small(), [1, 2])
    with pytest.raises(ValueError, match="seeds must be 2 integers from 0"):
        swarm.restart(seeds)


def test_a_policy_new_to_the_missions_is_started():
    swarm, again = Swarm(small(), [1]), Swarm(small(), [1])
    policy = RandomFlooding(0.5)
    again.start(policy)
    expected = [again.step(policy).packets.sent for _ in range(3)]
    np.testing.assert_array_equal([swarm.step(policy).packets.sent for _ in range(3)], expected)
    swarm.restart([1])
    np.testing.assert_array_equal([swarm.step(policy).packets.sent for _ in range(3)], expected)


def test_a_policy_must_say_what_it_knows():
    with pytest.raises(TypeError, match="DecentralisedPolicy or a CentralisedPolicy"):
        Swarm(small(), [1]).step(Policy())


def test_a_swarm_flies_once():
    swarm = Swarm(small(), [1])
    list(rollout(swarm, RandomFlooding(0.1)))
    with pytest.raises(ValueError, match="flown 5 windows already; restart"):
        next(rollout(swarm, RandomFlooding(0.1)))


def test_a_policy_may_reuse_its_array():
    """The record of a phase is a copy of what the policy returned."""
    swarm = Swarm(small(), [1])
    recipient = np.array([[1, 1, 2, 3, 4]])
    swarm.step_with_recipients(recipient)
    recipient[:] = 0
    np.testing.assert_array_equal(swarm.phases[0].recipient, [[1, 1, 2, 3, 4]])


@pytest.mark.parametrize("velocity_ratio", [0.15, 5.0])
def test_the_mirror_folds_as_often_as_needed(velocity_ratio):
    """In 10 s a robot crosses this area of 14 m many times; a triangle wave says where it ends."""
    mission = small(
        num_robots=2, density_per_km2=10_000.0, velocity_ratio=velocity_ratio, window_s=10.0
    )
    half = mission.half_side_m
    speed = mission.max_velocity_mps
    worlds = PointWorlds(mission, 1)
    worlds.place(np.zeros((1, 2, 2)), np.full((1, 2, 2), speed))
    states = worlds.step(np.zeros((1, 2, 2)))
    phase = (speed * 10.0 + half) % (4.0 * half)
    expected = phase - half if phase <= 2.0 * half else 3.0 * half - phase
    np.testing.assert_allclose(states.position_m, expected, atol=1e-9)
    assert np.all(np.abs(states.velocity_mps) == speed)


@pytest.mark.parametrize(("velocity_ratio", "window_s"), [(5.0, 0.1), (5.0, 0.014), (2.5, 0.014)])
def test_fast_robots_leave_the_area_by_no_more_than_their_radius(velocity_ratio, window_s):
    mission = small(physics="contact", velocity_ratio=velocity_ratio, window_s=window_s)
    rng = np.random.default_rng(0)
    worlds = PointWorlds(mission, 4)
    limit, speed = mission.half_side_m, mission.max_velocity_mps
    worlds.place(rng.uniform(-limit, limit, (4, 5, 2)), rng.choice([-speed, speed], size=(4, 5, 2)))
    worst = 0.0
    for _ in range(int(8.0 * limit / speed / window_s)):
        states = worlds.step(rng.normal(0.0, 20.0, (4, 5, 2)))
        worst = max(worst, float(np.max(np.abs(states.position_m))))
    assert limit < worst <= limit + 0.5


# Arguments of another kind, which the checks of types in these tests would refuse in their words.
OF_ANOTHER_KIND = {
    "Mission(num_robot=3)": "unexpected keyword argument 'num_robot'; did you mean num_robots?",
    "paper(robots=3)": "Mission got an unexpected keyword argument 'robots'; ",
    "reference('flok')": "'flok'; did you mean flocking?",
    "paper(num_robots='20')": "number of robots must be a whole number from 2 to 10000 [robots], "
    "not '20'",
    "Swarm(mission, seeds=1)": "seeds must be a list, one per mission, such as [1], not 1",
    "Swarm(mission, '12')": "seeds must be a list",
    "Swarm('flocking', [1])": 'mission must be of the type Mission, such as paper("flocking")',
    "Swarm(mission, [1], channel=3)": "channel must be a function, or an object like one, not 3",
    "Swarm(mission, [1], controller=Tdma)": "not the class Tdma; make an object of it, Tdma(...)",
    "Swarm(mission, [1], num_threads='2')": "num_threads must be a whole number from 1 to",
    "Swarm(mission, [1]).restart(1)": "seeds must be a list",
    "Swarm(mission, [1]).step('tdma')": 'policy must be of the type Policy, such as make_policy("',
    "list(rollout(Swarm(mission, [1]), Tdma))": "not the class Tdma; make an object of it",
    "list(rollout(mission, Tdma()))": "swarm must be of the type Swarm, such as Swarm(mission, [1]",
    "swarm_mj.fly('floking')": "not 'floking'; did you mean flocking?",
    "swarm_mj.fly(policy=3)": 'policy must be of the type str or Path, such as "planner", not 3',
    "swarm_mj.fly(policy=Tdma)": "not the class Tdma; make an object of it, Tdma(...)",
    "swarm_mj.fly(seed='1', record=False)": "seeds must be one or more integers",
    "swarm_mj.fly(observer='r1', num_windows=3)": "observer must be from 0 to 39",
    "swarm_mj.evaluate([3])": 'evaluate takes the policy by name, such as "my_file:Name", not 3:',
    "swarm_mj.evaluate(Tdma())": 'by name, such as "my_file:Name", not <swarm_mj',
    "swarm_mj.evaluate([Tdma()])": 'by name, such as "my_file:Name", not <swarm_mj',
    "swarm_mj.evaluate(channel=Tdma)": 'channel by name, such as "my_file:Name"',
    "swarm_mj.fly(mission, num_robots=3)": "part of it: dataclasses.replace(mission, num_robots=3)",
    "make_policy('plannr', mission)": "not 'plannr'; did you mean planner?",
    "make_policy(3, mission)": 'policy must be of the type str, such as "planner", not 3',
    "make_policy('planner', 'flocking')": "mission must be of the type Mission",
    "make_policy('aloha', mission, '0.3')": "probability must be from 0 to 1, not '0.3'",
    "make_policy('tdma', mission, '0.3')": "tdma takes no transmission probability; leave out 0.3",
}
MISTAKES = f"""
import swarm_mj
from swarm_mj.mission import Mission, paper, reference
from swarm_mj.policies import make_policy
from swarm_mj.policies.tdma import Tdma
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm
mission = paper("stationary", num_robots=5, num_windows=5)
for mistake, complaint in {OF_ANOTHER_KIND!r}.items():
    try:
        eval(mistake)
    except (TypeError, ValueError) as error:
        if complaint not in str(error) or "\\n" in str(error):
            print(mistake, "->", error)
    else:
        print(mistake, "passed")
"""


def test_arguments_of_another_kind_are_refused_in_one_line(forks, tmp_path):
    program = tmp_path / "mistakes.py"
    program.write_text(MISTAKES)
    done = forks.run(tmp_path, program)
    assert (done.stdout, done.stderr) == ("", "")


def test_a_flight_is_summarised_as_it_is_flown():
    mission = small()
    kept = summarise(list(rollout(Swarm(mission, [1, 2]), RandomFlooding(0.5))))
    flown = summarise(rollout(Swarm(mission, [1, 2]), RandomFlooding(0.5)))
    np.testing.assert_array_equal(flown.aoi_mean, kept.aoi_mean)
