"""The energy that robots with bodies use: momentum theory of rotors, and work of all other motors.

A rotor's ideal power in hover is T^(3/2) / sqrt(2 rho A), for a thrust T through a disk of area A
(Leishman, Principles of Helicopter Aerodynamics, 2006, section 2.2.4). What its shaft takes is that
over the figure of merit (section 2.3). It is used in all of a flight, not only in hover: moving
forward lowers a rotor's induced power and raises its other losses. Any other motor's power is force
times speed, where that is positive: braking gives nothing back.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.physics.declarations import Declarations
from swarm_mj.system.compiled import compiled


class Motors(NamedTuple):
    """The energy of one step of a robot's U motors; each is a rotor or it is none."""

    of_lift: Float[np.ndarray, "U"]  # of a rotor, by its force to the power of 3/2 [J/N^1.5]
    of_work: Float[np.ndarray, "U"]  # of any other, by its power [J/W]
    idle_j: float  # of the robot, at all times


def motors_of(
    lift: Float[np.ndarray, "U"], declared: Declarations, step_s: float, air_density: float
) -> Motors | None:
    """Return what the motors of a robot's model use.

    Args:
        lift: How hard each of its plain motors pushes the base, by its force in MuJoCo's sense, to
            which a gear comes; 0 of all other actuators. Those that push are the rotors of a model
            that declares their radius.
        declared: Its numbers.
        step_s: MuJoCo's step.
        air_density: Of the air around it [kg/m³].

    Returns:
        The energy of a step; None if the model does not say.
    """
    if declared.efficiency is None:
        return None
    used_s = step_s / declared.efficiency
    of_lift = np.zeros(len(lift))
    of_work = np.full(len(lift), used_s)
    if declared.rotor_radius_m is not None:
        disk_m2 = math.pi * declared.rotor_radius_m**2
        of_lift = lift**1.5 * used_s / math.sqrt(2.0 * air_density * disk_m2)
        of_work[lift > 0.0] = 0.0
    return Motors(of_lift=of_lift, of_work=of_work, idle_j=step_s * declared.idle_power_w)


@compiled(makes_arrays=False)
def use_energy(
    motors: Motors,
    force_n: Float[np.ndarray, "B n U"],
    speed_mps: Float[np.ndarray, "B n U"],
    has_crashed: Bool[np.ndarray, "B n"],
    energy_j: Float[np.ndarray, "B n"],
) -> None:
    """Add the energy of one step to that of each robot; those that crashed are off.

    Forces and speeds are MuJoCo's, of a motor that turns the robot in Nm and rad/s.
    """
    for b in range(energy_j.shape[0]):
        for i in range(energy_j.shape[1]):
            if has_crashed[b, i]:
                continue
            used_j = motors.idle_j
            for u in range(force_n.shape[2]):
                size_n = abs(force_n[b, i, u])
                used_j += motors.of_lift[u] * size_n * math.sqrt(size_n)
                used_j += motors.of_work[u] * max(force_n[b, i, u] * speed_mps[b, i, u], 0.0)
            energy_j[b, i] += used_j
