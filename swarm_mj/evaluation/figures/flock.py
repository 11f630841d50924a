"""Fig. 2: a flock at its start and at its end, by the velocities of its robots."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.quiver import Quiver

from swarm_mj.evaluation.figures.style import FAINT, WIDTH_IN, code, styled, write_caption
from swarm_mj.evaluation.results import LARGER_PACKETS
from swarm_mj.mission import PAPERS, Mission
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.costs import velocity_variance
from swarm_mj.protocol.mission_costs import VELOCITY_VARIANCE
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.packages import commit, version

ARROW_SHARE = 0.13  # of a panel's width: the length of its longest arrow


def draw_flock(preset: str, policy_name: str, seed: int) -> Figure:
    """Draw a flock's start and end, by the velocities of its robots (Fig. 2).

    Args:
        preset: `paper` or `reference`.
        policy_name: Who talks to whom.
        seed: Of the mission, which is flown to its end.

    Returns:
        The figure, which `style.save` writes.

    Raises:
        ValueError: There is no such policy, or the seed is not one.
    """
    mission = PAPERS[preset]("flocking")
    policy = make_policy(policy_name, mission)
    swarm = Swarm(mission, [seed])
    start = swarm.states
    for _ in rollout(swarm, policy):
        pass
    carries = f" ({LARGER_PACKETS})" if policy.carries_more else ""
    flown = f"{mission.num_robots} robots, policy {policy_name}{carries}, seed {seed}"
    about = f"fig2, preset {preset}: {flown}, {mission.num_windows} windows"
    with styled():
        drawing = Figure(figsize=(WIDTH_IN, 4.2), layout="constrained")
        panels = drawing.subplots(1, 2, sharex=True, sharey=True)
        first = _draw(panels[0], mission, 0.0, start)
        last = _draw(panels[1], mission, mission.num_windows * mission.window_s, swarm.states)
        first.set_clim(0.0)
        last.set_norm(first.norm)
        panels[0].set_ylabel("y [m]")
        drawing.colorbar(first, ax=panels, label="distance from the team's mean velocity [m/s]")
        title = "A flock at its start and its end"
        drawing.suptitle(title, x=0.01, ha="left", fontsize=12, fontweight="bold")
        write_caption(drawing, f"{about}; {code(version(), commit())}")
    return drawing


def _draw(axes: Axes, mission: Mission, time_s: float, team: RobotStates) -> Quiver:
    """Draw one moment; each panel has its own scale of arrows, shown by its key."""
    corner_m = -mission.half_side_m
    side_m = mission.side_m
    area = Rectangle((corner_m, corner_m), side_m, side_m, fill=False, color=FAINT, linestyle=":")
    axes.add_patch(area)
    x_m, y_m = team.position_m[0].T
    velocity_mps = team.velocity_mps[0]
    apart_mps = np.linalg.norm(velocity_mps - np.mean(velocity_mps, axis=0), axis=1)
    axes.scatter(x_m, y_m, s=9.0, color=FAINT)
    fastest_mps = np.max(np.linalg.norm(velocity_mps, axis=1))
    arrows = axes.quiver(x_m, y_m, *velocity_mps.T, apart_mps, scale=fastest_mps / ARROW_SHARE)
    key_mps = float(f"{fastest_mps:.1g}")
    axes.quiverkey(arrows, 0.8, 1.11, key_mps, f"{key_mps:g} m/s", labelpos="E", color=FAINT)
    variance_m2ps2 = velocity_variance(team.velocity_mps)[0]
    cost = VELOCITY_VARIANCE
    axes.set_title(f"after {time_s:g} s\n{cost.title} {variance_m2ps2:.2g} {cost.unit}")
    axes.set_xlabel("x [m]")
    axes.set_aspect("equal")
    axes.margins(0.15)  # for arrows
    return arrows
