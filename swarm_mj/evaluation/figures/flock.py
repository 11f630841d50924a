"""Fig. 2: a flock at its start and at its end, by the velocities of its robots."""

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import MultipleLocator

from swarm_mj.evaluation.figures.style import FAINT, WIDTH_IN, styled, write_caption
from swarm_mj.evaluation.results import CARRIES_MORE
from swarm_mj.mission import PAPERS, Mission
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.costs import velocity_variance
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.packages import commit, version

ARROW_SHARE = 0.13  # of a panel's width: the length of its longest arrow
MARGIN_M = 150.0  # around the robots, for their arrows
KM = 1000.0


def fly_flock(mission: Mission, policy_name: str, seed: int) -> tuple[RobotStates, RobotStates]:
    """Return the team before and after a mission; raise ValueError for no policy or no seed."""
    policy, swarm = make_policy(policy_name, mission), Swarm(mission, [seed])
    start = swarm.states
    for _ in rollout(swarm, policy):
        pass
    return start, swarm.states


def disagreement_mps(team: RobotStates) -> Float[np.ndarray, "N"]:
    """Return the distance of each robot's velocity from the team's mean."""
    velocity_mps = team.velocity_mps[0]
    return np.linalg.norm(velocity_mps - np.mean(velocity_mps, axis=0), axis=1)


def draw_flock(preset: str, policy_name: str, seed: int) -> Figure:
    """Fly the preset's flock and draw its start and end, an arrow per robot (Fig. 2).

    The colour is the distance of a robot's velocity from the team's mean. Raises ValueError as
    `fly_flock` does.
    """
    mission = PAPERS[preset]("flocking")
    start, end = fly_flock(mission, policy_name, seed)
    moments = {0.0: start, mission.num_windows * mission.window_s: end}
    with styled():
        drawing = Figure(figsize=(WIDTH_IN, 4.2))
        *panels, bar = drawing.subplots(1, 3, width_ratios=[1.0, 1.0, 0.04])
        drawing.subplots_adjust(left=0.08, right=0.925, top=0.8, bottom=0.18, wspace=0.12)
        largest_mps = float(np.max(disagreement_mps(start)))
        colours = ScalarMappable(Normalize(0.0, largest_mps), "viridis")
        for axes, (time_s, team) in zip(panels, moments.items(), strict=True):
            _draw(axes, mission, time_s, team, colours)
            _frame(axes, np.concatenate([start.position_m[0], end.position_m[0]]))
        panels[0].set_ylabel("y [km]")
        panels[1].tick_params(labelleft=False)
        drawing.colorbar(colours, cax=bar, label="distance from the team's mean velocity [m/s]")
        title = "A flock at its start and its end"
        drawing.text(0.08, 0.93, title, fontsize=12, fontweight="bold")
        write_caption(drawing, 0.08, 0.03, _caption(mission, policy_name, seed))
    return drawing


def _draw(
    axes: Axes, mission: Mission, time_s: float, team: RobotStates, colours: ScalarMappable
) -> None:
    """Draw one moment; each panel has its own scale of arrows, shown by its key."""
    fastest_mps = float(np.max(np.linalg.norm(team.velocity_mps[0], axis=1)))
    corner, side = -mission.half_side_m / KM, mission.side_m / KM
    area = Rectangle((corner, corner), side, side, fill=False, color=FAINT, linewidth=0.6)
    area.set_linestyle((0, (4, 4)))
    axes.add_patch(area)
    x, y = team.position_m[0].T / KM
    velocity_x, velocity_y = team.velocity_mps[0].T
    colour = colours.to_rgba(disagreement_mps(team))
    axes.scatter(x, y, s=9.0, color=colour, zorder=3)
    arrows = axes.quiver(
        x,
        y,
        velocity_x,
        velocity_y,
        color=colour,
        scale=fastest_mps / ARROW_SHARE,
        scale_units="width",
        width=0.006,
        zorder=2,
    )
    key_mps = float(f"{fastest_mps:.1g}")
    axes.quiverkey(arrows, 0.8, 1.11, key_mps, f"{key_mps:g} m/s", labelpos="E", color=FAINT)
    variance = _power(float(velocity_variance(team.velocity_mps)[0]))
    axes.set_title(f"after {time_s:g} s\nvelocity variance {variance} m²/s²")
    axes.set_xlabel("x [km]")


def _power(value: float) -> str:
    """Return a number with two digits, and its power of ten as it is written by hand."""
    digits, _, exponent = f"{value:.2g}".partition("e")
    return rf"{digits}$\times$10$^{{{int(exponent)}}}$" if exponent else digits


def _frame(axes: Axes, position_m: Float[np.ndarray, "P 2"]) -> None:
    low = (np.min(position_m, axis=0) - MARGIN_M) / KM
    high = (np.max(position_m, axis=0) + MARGIN_M) / KM
    centre, half = (low + high) / 2.0, float(np.max(high - low)) / 2.0
    axes.set_xlim(centre[0] - half, centre[0] + half)
    axes.set_ylim(centre[1] - half, centre[1] + half)
    axes.set_aspect("equal")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(0.5))
        axis.set_major_formatter("{x:g}")


def _caption(mission: Mission, policy_name: str, seed: int) -> str:
    code = f"swarm_mj {version()}" + (f", commit {commit()}" if commit() else "")
    carries = "" if make_policy(policy_name, mission).payload == "none" else f" ({CARRIES_MORE})"
    flown = f"{mission.num_robots} robots, policy {policy_name}{carries}, seed {seed}"
    return f"fig2, preset {mission.preset}: {flown}, {mission.num_windows} windows; {code}"
