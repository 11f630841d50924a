"""The memory that missions side by side take, so that a team too large is refused before it flies.

The constants are peaks measured on Linux, with all tasks and policies. Tests compare estimates with
peaks: those of flights of large teams should be right within 20 %, others within a factor of 2.
"""

from swarm_mj.mission import Mission
from swarm_mj.policies.registry import (
    about_of,
    is_learned,
    is_own_policy,
    remembers_packets,
    takes_memory_as,
)
from swarm_mj.system.needs import GB
from swarm_mj.system.user_code import load

LIBRARIES = 0.15 * GB  # compiling included
FLYING = 0.055 * GB  # of these, what a single flight takes whose code is compiled already
TORCH = 0.4 * GB  # with the code that trains
# Of a robot in MuJoCo's model, however many missions there are [bytes].
ROBOT = 8.5e3  # a point
BODY = 66e3  # a quadrotor
# Of a mission and each pair of its robots [bytes].
PAIR = 57.0  # the tables of robots, costs and the radio
LEARNED_PAIR = 450.0  # these, and the network's input
HEARD_ENTRY = 4.0  # an entry of a packet that some learned policies remember, N of each pair
# Where these entries are most of it, a message says so: nobody expects a table of N^3.
REMEMBERING = 120


def policy_memory(policy: str, mission: Mission, num_missions: int = 1) -> float:
    """Return the memory of missions side by side that a policy flies [bytes].

    Args:
        policy: A name that `make_policy` takes. What the policy takes itself counts if it says so.
        mission: What all of them are.
        num_missions: B.

    Returns:
        The process's memory, its libraries included [bytes].

    Raises:
        ValueError: A user's own policy cannot be imported.
    """
    if is_own_policy(policy):
        load("policy", policy)
    policy = takes_memory_as(policy)
    robots = (BODY if mission.has_bodies else ROBOT) * mission.num_robots
    if is_learned(policy):
        remembers = remembers_packets(policy)
        tables = learned_memory(mission.num_robots, num_missions, remembers_packets=remembers)
        return robots + tables
    about = about_of(policy)
    own_pair = 0.0 if about is None else about.memory.of(mission)
    pairs = num_missions * mission.num_robots**2
    return LIBRARIES + robots + (PAIR + own_pair) * pairs


def learned_memory(num_robots: int, num_missions: int, *, remembers_packets: bool) -> float:
    """Return the memory of missions of N robots that a network flies, with its input [bytes].

    MuJoCo's model of these robots is not in it: `policy_memory` adds that.
    """
    pairs = num_missions * num_robots**2
    remembered = HEARD_ENTRY * num_robots if remembers_packets else 0.0
    return LIBRARIES + TORCH + (LEARNED_PAIR + remembered) * pairs


def memory_growth(policy: str, mission: Mission) -> str:
    """Return what to say of a policy's memory where it grows with the cube of the team, or ""."""
    num = mission.num_robots
    is_network = is_learned(takes_memory_as(policy))
    if num < REMEMBERING or not is_network or not remembers_packets(policy):
        return ""
    return f"{policy} remembers {num:,} numbers for each of {num:,} x {num:,} pairs of robots"
