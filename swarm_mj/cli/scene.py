"""`swarm-mj scene`: writes the composed MJCF model, or flies it in MuJoCo's viewer."""

import shlex
import time
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from swarm_mj.cli.mission_options import one_mission
from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import MAX_SEED
from swarm_mj.policies import registry
from swarm_mj.replay import view
from swarm_mj.simulation.components import Components
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import files_read, same_as, setting
from swarm_mj.system.interrupt import raise_if_interrupted
from swarm_mj.system.packages import need
from swarm_mj.system.terminal import plain_console, say_written, this_command
from swarm_mj.system.writing import Output, check_outputs, write_text

if TYPE_CHECKING:  # MuJoCo is slow to import
    from swarm_mj.replay.rendering.scene import SceneViewer
    from swarm_mj.simulation.swarm import Swarm

FILE = Path("scene.xml")
FLOWN_BY = "planner"  # as `swarm-mj fly` does, unless its packets are too large
PICTURES_PER_WINDOW = 5  # 50 a second, where windows last 100 ms


@dataclass(frozen=True, kw_only=True)
class SceneOptions:
    """The options of `swarm-mj scene`."""

    mission: Mission = one_mission()
    scene: str | None = same_as(Components, "scene")
    pilot: str | None = same_as(Components, "pilot")
    seed: int = setting(1, "of the mission whose start is shown", low=0, high=MAX_SEED)
    out: Path | None = setting(None, "the file to write", shown=str(FILE))
    force: bool = setting(False, "replace an existing file")
    view: bool = setting(
        False,
        "write no file, but fly the mission in MuJoCo's viewer, again and again, until its window "
        "is closed",
    )


def run(options: SceneOptions) -> int:
    """Run the command; return its exit code."""
    return _fly(options) if options.view else _write(options, options.out or FILE)


def _write(options: SceneOptions, out: Path) -> int:
    from swarm_mj.physics.scene import compose  # MuJoCo is slow to import
    from swarm_mj.simulation.swarm import Swarm

    raise_if_interrupted()  # before a file is written: what was loaded may have swallowed it
    mission = options.mission
    check_outputs(
        Output("scene", out, ".xml|.mjcf"),
        inputs=files_read(options),
        must_be_new=not options.force,
    )
    swarm = Swarm(mission, [options.seed], scene=options.scene, pilot=options.pilot)
    spec = compose(mission, start=swarm.states, scene=swarm.scene)
    spec.compile()
    write_text(out, spec.to_xml())
    side = f"{mission.side_m:.0f} m"
    file = shlex.quote(str(out))
    say_written(out, f"{mission.num_robots} robots on {side} by {side}")
    plain_console().print(
        "The viewer opens on their start; Load key also gives them their velocities.\n"
        f"Open it:  {this_command('python')} -m mujoco.viewer --mjcf={file}"
    )
    return DONE


def _fly(options: SceneOptions) -> int:
    """Fly the mission in a window; raise ValueError for what has no use there, or no display."""
    if options.out or options.force:
        raise ValueError("--out and --force are of files, and --view writes none; leave them out")
    view.need_display(
        "write a file to open elsewhere, by `swarm-mj scene`, or use `swarm-mj fly --live web`"
    )
    need("glfw", "MuJoCo's viewer")
    from swarm_mj.replay.rendering.scene import SceneViewer  # MuJoCo is slow to import
    from swarm_mj.simulation.swarm import Swarm

    mission = options.mission
    swarm = Swarm(mission, [options.seed], scene=options.scene, pilot=options.pilot)
    camera = view.CHASE if mission.has_bodies else view.MAP
    with closing(SceneViewer(mission, scene=swarm.scene, camera=camera)) as viewer:
        while True:
            _fly_once(swarm, viewer)
            if not viewer.is_open:
                return DONE
            swarm.restart([options.seed])


def _fly_once(swarm: "Swarm", viewer: "SceneViewer") -> None:
    """Fly a mission in its own time, from window to window, as long as the window is open."""
    from swarm_mj.replay.recorder import Recorder
    from swarm_mj.simulation.rollout import rollout

    mission = swarm.mission
    policy = registry.make_policy(registry.flown_name(FLOWN_BY, mission), mission)
    recorder = Recorder(swarm)
    start_s = time.monotonic()
    for window in rollout(swarm, policy):
        recorder.add(window)
        flown = recorder.num_windows
        if flown == 1:  # nothing to move on from
            viewer.show(recorder.piece({}, 0, 1), 0.0)
            time.sleep(mission.window_s)
            continue
        before = (flown - 2) // recorder.piece_windows * recorder.piece_windows
        seen = recorder.piece({}, before, flown)
        last = flown - before - 1
        for picture in range(1, PICTURES_PER_WINDOW + 1):
            share = picture / PICTURES_PER_WINDOW
            viewer.show(seen, last - 1 + share)
            if not viewer.is_open:
                return
            due_s = start_s + (flown - 1 + share) * mission.window_s
            time.sleep(max(0.0, due_s - time.monotonic()))
