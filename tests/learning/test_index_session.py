"""The training of an index: what a run leaves, and that it goes on as if it had never stopped."""

import math
from dataclasses import replace

import numpy as np
import pytest
from safetensors.numpy import load_file
from small_runs import StopAfter, go_on, run

from swarm_mj.learning.index_session import kinds_drawn, weights_at
from swarm_mj.learning.run_folder import CHECKPOINT, read_run
from swarm_mj.learning.settings import HELD_OUT_SEED, Training, usual_index_settings
from swarm_mj.mission import paper
from swarm_mj.policies.index.policy import IndexCsma
from swarm_mj.policies.index.weights import NUMBERS, START, flat, from_tensors
from swarm_mj.policies.registry import make_policy
from swarm_mj.policies.stored import load_policy, read_policy
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm

SMALL = replace(
    usual_index_settings(paper("stationary", num_windows=12, range_ratio=0.6), (4, 5), seed=3),
    missions=2,
    evaluate_every=600,
    held_out=2,
)
GENERATION = 12 * 2 * 12  # decisions


def numbers(folder):
    tensors = load_file(folder / "policy.safetensors")
    return flat(from_tensors(tensors)).tolist()


def end_of(folder):
    """The curve without its times, and the policy."""
    rows = (folder / "curve.csv").read_text().splitlines()
    names = rows[0].split(",")
    timed = {names.index(name) for name in names if name in ("minutes", "rollout/decisions_per_s")}
    kept = [[cell for n, cell in enumerate(row.split(",")) if n not in timed] for row in rows]
    return kept, numbers(folder)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("index") / "run"
    return folder, run(SMALL, folder, 5 * GENERATION)


def test_a_search_begins_at_the_start():
    assert np.array_equal(flat(weights_at(np.zeros((1, NUMBERS)))), flat(START))


def test_a_run_leaves_a_policy_that_flies_at_any_size(whole):
    folder, progress = whole
    assert progress.decisions == 5 * GENERATION
    assert [row.decisions for row in progress.curve] == [0, 3 * GENERATION, 5 * GENERATION]
    for num_robots in (2, 9, 30):
        mission = paper("random-walk", num_robots=num_robots, num_windows=5)
        policy = make_policy(str(folder), mission)
        assert isinstance(policy, IndexCsma)
        swarm = Swarm(mission, [1])
        swarm.start(policy)
        assert math.isfinite(swarm.step().age_windows[0])


def test_what_was_evaluated_is_what_is_stored(whole):
    """Evaluations fly the numbers that the file has."""
    folder, progress = whole
    assert progress.choice is not None
    kept = [row for row in progress.curve if row.decisions == progress.choice.decisions]
    ages = []
    for mission in SMALL.kinds:
        swarm = Swarm(mission, range(HELD_OUT_SEED, HELD_OUT_SEED + SMALL.held_out))
        ages.append(summarise(rollout(swarm, load_policy(folder, mission))).aoi_mean.mean())
    assert [row.costs.aoi for row in kept] == [pytest.approx(np.mean(ages), rel=1e-12)]
    assert read_run(folder).training == SMALL


def test_evaluations_say_how_packets_fared_and_what_the_search_did(whole):
    folder, progress = whole
    for row in progress.curve:
        assert 0.0 < row.costs.delivery_ratio <= 1.0
    last = progress.curve[-1].training
    assert last["train/generation"] == 5.0
    assert last["train/step"] > 0.0
    assert "aoi_behind_tdma" in (folder / "curve.csv").read_text()


def test_a_run_that_stopped_twice_ends_as_one_that_did_not(whole, tmp_path):
    folder, _ = whole
    cut = tmp_path / "cut"
    stops = []
    for is_resumed, windows in ((False, 5), (True, 30)):
        stopped = run(SMALL, cut, 5 * GENERATION, StopAfter(windows), is_resumed=is_resumed)
        stops.append(stopped.decisions)
    assert 0 < stops[0] < stops[1] < 5 * GENERATION
    run(SMALL, cut, 5 * GENERATION, go_on, is_resumed=True)
    assert end_of(cut) == end_of(folder)


def test_the_same_seed_is_the_same_policy_and_another_seed_another(whole, tmp_path):
    folder, _ = whole
    run(SMALL, tmp_path / "same", 5 * GENERATION)
    assert end_of(tmp_path / "same") == end_of(folder)
    run(replace(SMALL, seed=4), tmp_path / "other", 5 * GENERATION)
    assert end_of(tmp_path / "other")[0] != end_of(folder)[0]


def test_a_checkpoint_of_other_settings_is_refused(whole, tmp_path):
    folder, _ = whole
    copy = tmp_path / "copy"
    copy.mkdir()
    for name in ("settings.json", CHECKPOINT, "curve.csv"):
        (copy / name).write_bytes((folder / name).read_bytes())
    with pytest.raises(ValueError, match="made with other settings than the run's"):
        run(replace(SMALL, held_out=3), copy, 6 * GENERATION, is_resumed=True)


def test_a_policy_of_an_index_is_no_network_to_begin_with(whole):
    folder, _ = whole
    with pytest.raises(ValueError, match="is an index; name one that"):
        read_policy(folder)
    with pytest.raises(ValueError, match="draw no recipient; leave out --deterministic"):
        load_policy(folder, SMALL.kinds[0], is_deterministic=True)


@pytest.mark.parametrize(("missions", "least", "most"), [(2, 1, 1), (5, 2, 3), (1, 0, 1)])
def test_candidates_fly_all_kinds_as_often_but_for_a_rest_that_is_drawn(missions, least, most):
    training = replace(SMALL, missions=missions)
    rng = np.random.default_rng(1)
    drawn = [kinds_drawn(training, rng).tolist() for _ in range(20)]
    assert all(sum(each) == missions for each in drawn)
    assert {number for each in drawn for number in each} == {least, most}


def test_missions_with_sizes_of_their_own_are_kinds_as_they_are():
    first, second = paper("stationary", num_robots=4), paper("flocking", num_robots=7)
    training = Training(
        policy="index-csma", mission=first, other_missions=(second,), robots=(), missions=2
    )
    assert training.kinds == (first, second)
    assert training.most_robots == 7
    with pytest.raises(ValueError, match="reward velocity-variance is"):
        replace(training, reward="velocity-variance", credit_assignment="team")
