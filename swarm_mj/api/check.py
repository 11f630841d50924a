"""`swarm_mj.check_convergence`: do missions converge in time, as `swarm-mj check` asks."""

from collections.abc import Sequence
from pathlib import Path
from typing import Unpack

from swarm_mj.api.evaluate import check_named
from swarm_mj.api.fly import mission_of, names_of
from swarm_mj.evaluation.convergence import Convergence, Goal, converging
from swarm_mj.evaluation.engines import EngineOptions
from swarm_mj.evaluation.study import Study
from swarm_mj.evaluation.study_needs import study_needs
from swarm_mj.mission import Mission, PresetAndFields
from swarm_mj.simulation.components import Components
from swarm_mj.system.fields import check_value
from swarm_mj.system.needs import check_fits, memory_errors
from swarm_mj.system.packages import need
from swarm_mj.system.terminal import WorkBar, quiet_console


def check_convergence(
    task: str | Mission | None = None,
    *,
    policy: str | Path = "planner",
    within_s: float = 10.0,
    share: float = 0.8,
    below: float | None = None,
    unit: str | None = None,
    level: float = 0.95,
    max_missions: int = 1000,
    seed: int = 1000,
    probability: float | None = None,
    is_deterministic: bool = False,
    channel: str | None = None,
    controller: str | None = None,
    scene: str | None = None,
    pilot: str | None = None,
    features: str | Sequence[str] = (),
    networks: str | Sequence[str] = (),
    num_jobs: int = 1,
    **mission_fields: Unpack[PresetAndFields],
) -> Convergence:
    """Fly missions until it is certain whether enough of them converge in time.

    A flock has converged from the first window on from which under 1 % of its first velocity
    variance is left, to the mission's end. The same arguments give the same answer as `swarm-mj
    check` does, whatever `num_jobs` is.

    Args:
        task: The robots' task by name, or a `Mission`. None is as in `fly`.
        policy: A name of `POLICIES`, a learned one's folder, or `module:Name` of your own.
        within_s: By when missions must have converged [s].
        share: How many of all missions must, from 0 to 1.
        below: Of a controller with a cost of its own: below which cost a mission has converged, in
            the controller's unit.
        unit: The unit that `below` is meant in; another one is refused.
        level: How certain the answer must be.
        max_missions: After which it stays undecided.
        seed: Of the first mission; the others follow one by one.
        probability: As in `evaluate`.
        is_deterministic: As in `evaluate`.
        channel: Who decodes whom, by `module:Name`; the mission's radio unless given.
        controller: What drives the robots, likewise; that of the task unless given.
        scene: A function that edits the MuJoCo model, likewise; none unless given.
        pilot: What makes the controls of robots with bodies, likewise; the robot's unless given.
        features: Names of your own feature extractors that a learned policy was trained with.
        networks: Names of your own networks that it decides by.
        num_jobs: Processes, as in `evaluate`.
        **mission_fields: Any field of `Mission`, in its unit, such as `num_robots=20`.

    Returns:
        The answer: true if the claim holds, so that a test may assert it; printed, it says why.

    Raises:
        ValueError: A value is unknown or out of range, missions are shorter than `within_s`, or the
            task has no cost that could converge.
        TypeError: An argument is of the wrong kind, or unknown.
        KeyboardInterrupt: Ctrl-C; nothing is kept.

    Example:
        ```python
        import swarm_mj

        def test_flocks_agree():
            assert swarm_mj.check_convergence(policy="tdma", within_s=10, share=0.8)
        ```
    """
    need("scipy", "a check")
    mission = mission_of(check_convergence, task, mission_fields)
    components = {"channel": channel, "controller": controller, "scene": scene, "pilot": pilot}
    for kind, name in components.items():
        check_named("check_convergence", kind, name)
    check_named("check_convergence", "policy", policy)
    check_value(EngineOptions.__dataclass_fields__["jobs"], num_jobs, "num_jobs")
    check_value(Study.__dataclass_fields__["episodes"], max_missions, "max_missions")
    goal = Goal(within_s=within_s, share=share, below=below, unit=unit, level=level)
    study = Study(
        policies=(str(policy),),
        regimes=(mission,),
        episodes=max_missions,
        seed=seed,
        probability=probability,
        is_deterministic=is_deterministic,
        features=names_of(features),
        networks=names_of(networks),
        components=Components(**components),
    )
    options = EngineOptions(jobs=num_jobs)
    needs = study_needs(study, options.jobs_here)
    way_out = "choose fewer num_jobs, num_robots, num_windows or max_missions"
    check_fits(needs, None, way_out, is_forced=False, way_on="")
    bar = WorkBar("Flying", max_missions, "missions at most", console=quiet_console())
    found = None
    with memory_errors(), bar:
        for found in converging(study, goal, options.engine_for(study)):
            bar.move_to(found.num_missions)
    assert found is not None, "a study has at least one batch"
    return found
