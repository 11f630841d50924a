"""`swarm-mj scene`: writes the composed MJCF model."""

import shlex
from dataclasses import dataclass
from pathlib import Path

from swarm_mj.cli.mission_options import one_mission
from swarm_mj.mission import Mission
from swarm_mj.simulation.components import Components
from swarm_mj.system.fields import files_read, same_as, setting
from swarm_mj.system.interrupt import raise_if_interrupted
from swarm_mj.system.terminal import plain_console, this_command
from swarm_mj.system.writing import Output, check_outputs, write_text


@dataclass(frozen=True, kw_only=True)
class SceneOptions:
    """The options of `swarm-mj scene`."""

    mission: Mission = one_mission()
    scene: str | None = same_as(Components, "scene")
    pilot: str | None = same_as(Components, "pilot")
    seed: int = setting(1, "of the mission whose start is shown")
    out: Path = setting(Path("scene.xml"), "the file to write")
    force: bool = setting(False, "replace an existing file")


def run(options: SceneOptions) -> int:
    """Run the command; return its exit code."""
    from swarm_mj.physics.scene import compose  # MuJoCo is slow to import
    from swarm_mj.simulation.swarm import Swarm

    raise_if_interrupted()  # before a file is written: what was loaded may have swallowed it
    mission = options.mission
    check_outputs(
        Output("scene", options.out, ".xml|.mjcf"),
        inputs=files_read(options),
        must_be_new=not options.force,
    )
    swarm = Swarm(mission, [options.seed], scene=options.scene, pilot=options.pilot)
    spec = compose(mission, start=swarm.states, scene=swarm.scene)
    spec.compile()
    write_text(options.out, spec.to_xml())
    side = f"{mission.side_m:.0f} m"
    file = shlex.quote(str(options.out))
    plain_console().print(
        f"Wrote {options.out}: {mission.num_robots} robots on {side} by {side}\n"
        "The viewer opens on their start; Load key also gives them their velocities.\n"
        f"Open it:  {this_command('python')} -m mujoco.viewer --mjcf={file}"
    )
    return 0
