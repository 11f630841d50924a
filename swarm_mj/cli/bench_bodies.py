"""How fast robots with bodies are: 40 quadrotors and the same team of points, timed in turn."""

from collections.abc import Callable, Iterator

import numpy as np
from mujoco._functions import mj_step
from mujoco._structs import MjData

from swarm_mj.cli.bench_simulation import MISSION, Row, in_turn_us, microseconds, talking
from swarm_mj.mission import paper
from swarm_mj.physics.pilots import Pilot, QuadrotorPilot, Sensed, SetPoint
from swarm_mj.physics.robots import kinds_of
from swarm_mj.physics.scene import compose, num_body_steps
from swarm_mj.policies.centralised import RoundRobin
from swarm_mj.simulation.swarm import Swarm

QUADROTORS = paper("random-walk", robot="quadrotor")
SETTLING_WINDOWS = 20  # after which quadrotors tilt and fly as they do from then on
PLAIN_STEP = "one plain MuJoCo step of 40 quadrotors"
IN_STEPS = "  in plain MuJoCo steps, each of a window's"
TIMES_POINTS = "  times a window of points"


def body_rows(num_missions: int, seconds: float) -> Iterator[Row]:
    """Time random walks of 40 quadrotors with round robin, B side by side, per window of one.

    All is the time of one thread on a processor. What is compared is measured in turn.
    """
    swarm = Swarm(QUADROTORS, range(num_missions))
    points = Swarm(MISSION, range(num_missions))
    swarm.start(RoundRobin())
    points.start(RoundRobin())
    for _ in range(SETTLING_WINDOWS):
        swarm.step()
    talk = talking(swarm, swarm.decide())
    kinds = kinds_of(QUADROTORS)
    num_steps = num_body_steps(QUADROTORS, kinds)
    pilot = QuadrotorPilot(kinds[0].airframe(QUADROTORS.window_s / num_steps))
    many_us, many_points_us, step_us = in_turn_us(
        (swarm.step, points.step, plain_step(swarm)), seconds
    )
    window_us = many_us / num_missions
    points_us = many_points_us / num_missions
    pilot_us = num_steps * microseconds(steering(pilot, num_missions), seconds / 4)
    yield Row("time of one window of one mission", window_us)
    yield Row(f"{IN_STEPS} {num_steps}", window_us / num_steps / step_us, "{:.2f}")
    yield Row(PLAIN_STEP, step_us)
    yield Row("such a window of points", points_us)
    yield Row(TIMES_POINTS, window_us / points_us, "{:.0f}", ends_section=True)
    move_us = microseconds(swarm.move, seconds / 4)
    yield Row("  MuJoCo and pilot move the robots", move_us / num_missions)
    yield Row("    of these, the pilot", pilot_us / num_missions)
    yield Row("  the radio delivers, buffers merge", microseconds(talk, seconds / 4) / num_missions)


def plain_step(swarm: Swarm) -> Callable[[], None]:
    """Return an mj_step of 40 quadrotors, always from where those of the first mission are."""
    model = compose(QUADROTORS).compile()
    data = MjData(model)
    position, rate = swarm.pose
    flying = position[0].copy()
    moving = rate[0].copy()

    def step() -> None:
        data.qpos[:] = flying  # or they would fall to the floor, where steps cost more
        data.qvel[:] = moving
        mj_step(model, data)

    return step


def steering(pilot: Pilot, num_missions: int) -> Callable[[], None]:
    """Return a call of a pilot for 40 level quadrotors of each mission."""
    shape = (num_missions, QUADROTORS.num_robots)
    attitude = np.zeros((*shape, 4))
    attitude[..., 0] = 1.0
    still = np.zeros((*shape, 3))
    sensed = Sensed(still, attitude, still, still, np.zeros((*shape, 0)))
    wanted = SetPoint(np.ones((*shape, 3)), np.zeros(shape))
    control = np.zeros((*shape, 4))
    return lambda: pilot(sensed, wanted, control)
