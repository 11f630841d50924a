"""Estimates by hand, and against the arrays that are made; faults/test_fit.py measures peaks."""

from dataclasses import replace

import pytest

from swarm_mj.api import estimates
from swarm_mj.api.estimates import (
    Needs,
    check_fits,
    figures_needs,
    flight_needs,
    rollout_bytes,
    study_needs,
    training_needs,
    video_needs,
)
from swarm_mj.evaluation.study import Study
from swarm_mj.learning.run_folder import Limits
from swarm_mj.learning.settings import usual_settings
from swarm_mj.learning.train import make_model
from swarm_mj.mission import paper
from swarm_mj.policies.gnn.packet_memory import empty_memory
from swarm_mj.simulation.swarm import Swarm

LONG = paper("random-walk", num_robots=1000, num_windows=100_000)


@pytest.fixture
def machine(monkeypatch):
    """8 GB of memory, 2 GB of disk, and addresses without a limit."""

    def set_to(memory=8e9, addresses=None, room=2e9, most=None):
        monkeypatch.setattr(estimates, "free_memory", lambda: memory)
        monkeypatch.setattr(estimates, "free_addresses", lambda: addresses)
        monkeypatch.setattr(estimates, "free_room", lambda _: room)
        monkeypatch.setattr(estimates, "largest_file", lambda: most)

    set_to()
    return set_to


def refusal(needs, output=None):
    with pytest.raises(ValueError, match=r"or try it with --yes$") as refused:
        check_fits(needs, output, "fly less", is_forced=False)
    check_fits(needs, output, "fly less", is_forced=True)
    return str(refused.value)


def test_what_fits_passes(machine, tmp_path):
    check_fits(Needs(memory=8e9, file=2e9), tmp_path, "", is_forced=False)
    check_fits(Needs(memory=1e9, file=1e12), None, "", is_forced=False)
    machine(addresses=5e9)
    check_fits(Needs(memory=3e9, addresses=2e9), None, "", is_forced=False)


def test_a_refusal_names_need_limit_and_way_out(machine, tmp_path):
    line = refusal(Needs(memory=53.2e9))
    assert line.startswith("this takes about 53.2 GB of memory, and 8 GB are free; fly less")
    line = refusal(Needs(memory=1e9, file=12e9), tmp_path)
    assert f"about 12 GB on disk, and 2 GB fit at {tmp_path}; fly less" in line
    machine(most=1e9)
    check_fits(Needs(memory=1e9, file=1.5e9, largest_file=1e9), tmp_path, "", is_forced=False)
    line = refusal(Needs(memory=1e9, file=1.5e9), tmp_path)
    assert "about 1.5 GB in one file, and 1 GB are allowed by ulimit -f" in line
    machine(addresses=1.5e9)
    line = refusal(Needs(memory=1e9, addresses=3e9))
    assert "about 4 GB of address space, and 1.5 GB are left by ulimit -v" in line


def test_missions_take_at_least_their_buffers():
    mission = paper("stationary", num_robots=200)
    buffers = vars(Swarm(mission, [1]).buffers).values()
    made = sum(array.nbytes for array in buffers)
    needs = flight_needs(mission, "tdma", is_recorded=False)
    assert made < needs.memory - estimates.LIBRARIES < 2.0 * made


def test_a_long_flight_of_many_takes_what_nobody_has():
    """By hand: 1016 kB of memory a window, 150.5 kB of disk."""
    needs = flight_needs(LONG, "tdma", is_recorded=True)
    assert needs.memory == pytest.approx(1e5 * 1.015e6, rel=0.01)
    assert needs.file == pytest.approx(1e5 * 150.5e3, rel=0.01)
    bare = flight_needs(LONG, "tdma", is_recorded=False)
    assert (bare.memory < 0.3e9, bare.file) == (True, 0.0)


def test_learned_policies_need_torch_and_what_their_robots_remember():
    own, rule = (flight_needs(LONG, name, is_recorded=False) for name in ("gnn", "tdma"))
    assert own.memory - rule.memory > 4 * 1000**3
    assert own.addresses > rule.addresses


def test_a_study_has_a_batch_in_each_process_while_batches_last():
    regimes = (paper("stationary", num_robots=100), paper("stationary", num_robots=10))
    study = Study(policies=("tdma", "gossip"), regimes=regimes, episodes=50)
    one, two, many = (study_needs(study, jobs).memory for jobs in (1, 2, 256))
    each = two - one
    assert each == pytest.approx(estimates.LIBRARIES + 100 * 25 * 100**2)
    assert many == pytest.approx(one + 7 * each)  # 2 regimes, 2 policies, 2 batches of 25


def test_a_studys_files_grow_with_its_missions():
    regimes = (paper("stationary", num_windows=100_000),)
    few, many = (
        study_needs(Study(policies=("tdma",), regimes=regimes, episodes=count), 1).file
        for count in (25, 25_000)
    )
    assert many == pytest.approx(1000 * few)
    assert many > 5e8


@pytest.mark.parametrize("arm", ["robot", "team"])
def test_a_rollout_is_of_the_arrays_that_are_made(arm):
    mission = paper("stationary", num_robots=6, range_ratio=0.5)
    training = replace(usual_settings(arm, mission, (6,)), missions=4)
    buffer = make_model(training)[0].rollout_buffer
    made = sum(rows.nbytes for rows in buffer.observations.values())
    assert made < rollout_bytes(training) < 2.0 * made


def test_a_rollout_counts_what_robots_remember_of_packets():
    """In teams of 40 more than the one graph a robot by which the estimate exceeds the rollout."""
    training = replace(usual_settings("robot", paper("stationary"), (40,)), missions=4)
    buffer = make_model(training)[0].rollout_buffer
    made = sum(rows.nbytes for rows in buffer.observations.values())
    made += sum(array.nbytes for array in empty_memory(4, 40))
    assert made < rollout_bytes(training)


def test_replays_of_a_training_are_counted():
    training = usual_settings("robot", paper("random-walk"), (40,))
    none = training_needs(training, Limits(decisions=1000))
    ten = training_needs(training, Limits(decisions=1000, replay_every=100))
    each = flight_needs(training.mission, "tdma", is_recorded=True).file
    assert ten.file - none.file == pytest.approx(11 * each)
    assert ten.memory > none.memory
    assert ten.addresses > none.addresses


def test_figures_take_more_for_larger_results(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"x" * 1000)
    one, two = (figures_needs([tmp_path / "a.csv"] * count, 2 * count) for count in (1, 2))
    assert two.memory - one.memory == 10_000
    assert two.file - one.file == 2e6
    assert figures_needs([tmp_path / "missing.csv", tmp_path], 1).memory < one.memory


def test_a_gif_s_pictures_are_kept_and_an_mp4_s_are_not():
    """500 pictures of 1000 by 1000."""
    gif, mp4 = (video_needs(1000, 1000, 500.0, suffix) for suffix in (".gif", ".mp4"))
    assert gif.memory - mp4.memory == pytest.approx(750e6)
    assert video_needs(1000, 1000, 5000.0, ".mp4").memory == mp4.memory
