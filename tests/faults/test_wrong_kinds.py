"""Arguments of wrong kinds, to what is public: refused by a sentence of ours, not by accident."""

import pytest

# Prints each call that was not refused by a `raise` of the package, in a line.
CALLS = """
import linecache, traceback
from pathlib import Path
import numpy as np
import swarm_mj
from stable_baselines3 import PPO
from swarm_mj.envs.gymnasium import SwarmEnv
from swarm_mj.envs.gymnasium_vector import SwarmVectorEnv
from swarm_mj.envs.pettingzoo import parallel_env
from swarm_mj.envs.sb3 import Flown, make_vec_env

WRONG = ["x", b"x", None, 5, 1.5, True, [], ["x"], [None], {}, {"x": 1}, object(), int, np.zeros(3)]
WRONG += [np.zeros(3, complex), float("nan"), 10**400, [[1], [2, 3]], lambda: 1]
SMALL = {"num_robots": 3, "num_windows": 3, "range_ratio": 1.0}
MISSION = swarm_mj.paper("stationary", **SMALL)
HOME = str(Path(swarm_mj.__file__).parent)
PLACES = np.zeros((3, 2))


def begun(make, *arguments, **options):
    env = make("stationary" if not arguments else arguments[0], *arguments[1:], **SMALL, **options)
    env.reset(seed=1) if make is not make_vec_env else env.reset()
    return env


def step_sb3(agent):
    env = begun(make_vec_env, agent=agent)
    return env.step


CALLS = {
    "Swarm, mission": lambda wrong: swarm_mj.Swarm(wrong, [1]),
    "Swarm, seeds": lambda wrong: swarm_mj.Swarm(MISSION, wrong),
    "Swarm, channel": lambda wrong: swarm_mj.Swarm(MISSION, [1], channel=wrong),
    "Swarm, controller": lambda wrong: swarm_mj.Swarm(MISSION, [1], controller=wrong),
    "Swarm, scene": lambda wrong: swarm_mj.Swarm(MISSION, [1], scene=wrong),
    "Swarm, threads": lambda wrong: swarm_mj.Swarm(MISSION, [1], num_threads=wrong),
    "Swarm.start": lambda wrong: swarm_mj.Swarm(MISSION, [1]).start(wrong),
    "Swarm.restart": lambda wrong: swarm_mj.Swarm(MISSION, [1]).restart(wrong),
    "recipients": lambda wrong: swarm_mj.Swarm(MISSION, [1]).step_with_recipients(wrong),
    "Link, mission": swarm_mj.Link,
    "Link, seeds": lambda wrong: swarm_mj.Link(MISSION, wrong),
    "Link.deliver, places": lambda wrong: swarm_mj.Link(MISSION).deliver(wrong, [True] * 3),
    "Link.deliver, senders": lambda wrong: swarm_mj.Link(MISSION).deliver(PLACES, wrong),
    "summarise": swarm_mj.summarise,
    "make_policy, name": lambda wrong: swarm_mj.make_policy(wrong, MISSION),
    "make_policy, mission": lambda wrong: swarm_mj.make_policy("tdma", wrong),
    "fly, task": lambda wrong: swarm_mj.fly(wrong, policy="tdma", record=False, **SMALL),
    "fly, policy": lambda wrong: swarm_mj.fly(MISSION, policy=wrong, record=False),
    "fly, seed": lambda wrong: swarm_mj.fly(MISSION, policy="tdma", seed=wrong, record=False),
    "fly, observer": lambda wrong: swarm_mj.fly(MISSION, observer=wrong, record=False),
    "evaluate, policies": lambda wrong: swarm_mj.evaluate(wrong, MISSION, num_missions=1),
    "evaluate, missions": lambda wrong: swarm_mj.evaluate("tdma", MISSION, num_missions=wrong),
    "evaluate, seed": lambda wrong: swarm_mj.evaluate("tdma", MISSION, num_missions=1, seed=wrong),
    "Flown, model": lambda wrong: Flown(wrong, MISSION),
    "Flown, mission": lambda wrong: Flown(PPO("MultiInputPolicy", begun(make_vec_env)), wrong),
    "SwarmEnv.step": begun(SwarmEnv).step,
    "SwarmVectorEnv.step": begun(SwarmVectorEnv, 2, "stationary").step,
    "parallel_env.step": begun(parallel_env).step,
    "an agent's action": lambda wrong: begun(parallel_env).step({"robot_0": wrong}),
    "robots of sb3": step_sb3("robot"),
    "teams of sb3": step_sb3("team"),
}
# What is right all the same: 5 is a seed and a number, True a whole number to nobody, and so on.
FINE = {
    ("Swarm, channel", "None"), ("Swarm, controller", "None"), ("Swarm, scene", "None"),
    ("Swarm, threads", "5"), ("Swarm, threads", "True"), ("fly, task", "None"), ("fly, seed", "5"),
    ("evaluate, missions", "5"), ("evaluate, seed", "5"),
    ("Flown, mission", "None"), ("parallel_env.step", "{}"),
    ("an agent's action", "True"),
}


def refusal(call, wrong):
    try:
        call(wrong)
    except Exception as error:
        frame, number = list(traceback.walk_tb(error.__traceback__))[-1]
        line = linecache.getline(frame.f_code.co_filename, number).strip()
        is_ours = frame.f_code.co_filename.startswith(HOME)
        is_one_line = len(str(error).splitlines()) == 1 and len(str(error)) < 600
        if is_ours and is_one_line and isinstance(error, (ValueError, TypeError)):
            return ""
        return f"{type(error).__name__}: {str(error)[:200]!r} at {line}"
    return "taken"


for name, call in CALLS.items():
    for wrong in WRONG:
        said = refusal(call, wrong)
        shown = f"{wrong!r:.40}"
        if said and (name, shown) not in FINE:
            print(f"{name} {shown}: {said}")
"""


@pytest.mark.fault("arguments of wrong kinds")
def test_what_is_of_a_wrong_kind_is_refused_by_a_sentence_of_ours(forks, tmp_path, record_property):
    """Fault 9: AttributeError, TypeError and numba's errors, of twenty lines."""
    script = tmp_path.with_suffix(".py")
    script.write_text(CALLS)
    done = forks.run(tmp_path, script)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    record_property("tries", 31 * 19)
