"""Studies as the command line names them."""

from swarm_mj.cli import make_parser
from swarm_mj.cli.study_options import study_of
from swarm_mj.mission import paper, reference
from swarm_mj.policies.registry import POLICIES


def study(*arguments):
    return study_of(make_parser().parse_args(["evaluate", *map(str, arguments)]))


def test_the_default_is_the_shipped_policy_and_the_papers_baselines_on_the_papers_flocks():
    default = study()
    assert default.policies == ("planner", "random-flooding", "round-robin", "mst")
    assert default.regimes == (paper("flocking"),)
    assert default.regimes[0].boundary == "none"
    assert (default.episodes, default.seed, default.compared_to) == (100, 1000, "planner")


def test_sweeps_multiply_and_values_follow_one_flag_or_several():
    regimes = study(
        *("--task", "stationary", "random-walk", "--robots", 10, "--robots", 20, 10),
        *("--preset", "reference", "--velocity-ratio", 0.3, "--range-ratio", 0.25, 0.5),
    ).regimes
    assert regimes == tuple(
        reference(task, num_robots=n, velocity_ratio=0.3, range_ratio=ratio)
        for task in ("stationary", "random-walk")
        for n in (10, 20)
        for ratio in (0.25, 0.5)
    )


def test_how_many_fail_is_swept_too():
    assert study("--robots", 10, "--switched-off", 0, 0.2).regimes == (
        paper("flocking", num_robots=10),
        paper("flocking", num_robots=10, switched_off=0.2),
    )


def test_all_is_every_policy_after_those_named():
    assert study("--policy", "all").policies == tuple(POLICIES)
    assert study("--policy", "mst", "--policy", "all").policies[0] == "mst"
    assert set(study("--policy", "mst", "all", "--range-ratio", 0.5).policies) == set(POLICIES)


def test_boundary_and_physics_are_the_presets_unless_given():
    (regime,) = study("--boundary", "reflect", "--physics", "contact").regimes
    assert (regime.boundary, regime.physics) == ("reflect", "contact")


def test_an_unknown_task_is_refused(swarm_mj):
    """As a process: the type checker of these tests would come first."""
    done = swarm_mj("evaluate", "--task", "stationary", "swim")
    assert done.returncode == 2
    assert "task must be one of stationary, random-walk, flocking, not 'swim'" in done.stderr


def test_the_planner_flies_without_payload_under_a_name_of_its_own():
    alone = "planner --payload none"
    named = study("--policy", "tdma", "planner", "--payload", "none", "--baseline", "planner")
    assert named.policies == ("tdma", alone)
    assert named.compared_to == alone
    assert study("--policy", "planner", alone).policies == ("planner", alone)
    assert study("--payload", "none").policies[0] == alone
