"""Training with parts of one's own: what is named again is loaded, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from swarm_mj.policies.stored import read_weights, save_weights

SMALL = ("--robots", 5, "--windows", 20, "--range-ratio", 0.6, "--missions", 4, "--held-out", 2)
SMALL = (*SMALL, "--evaluate-every", 256, "--latent", 6, "--depth", 2)
PARTS = """
from pathlib import Path

import numpy as np
from swarm_mj.policies.gnn.graphs import FeatureExtractor, Graphs
from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.radio.mission_radio import radio_of

with Path("imported.txt").open("a") as file:
    file.write("once more\\n")

class Lossy:
    def __init__(self, mission):
        self.radio = radio_of(mission)
    def start(self, num_robots, rngs):
        self.stream = Stream(rngs, uniform, (num_robots,))
    def __call__(self, position_m, recipient):
        heard = self.radio(position_m, recipient)
        return np.where(self.stream.next() < 0.3, np.arange(heard.shape[1]), heard)

class Ages(FeatureExtractor):
    names = ("age", "is oneself")
    def graphs(self, views):
        buffers, num = views.buffers, views.num_robots
        rows = (-1, num)
        age = (views.now[:, None, None] - buffers.timestamp) / self._mission.num_windows
        own = np.broadcast_to(np.eye(num), age.shape)
        node = np.stack([age, own], axis=-1).astype(np.float32).reshape(*rows, 2)
        return Graphs(
            node=node,
            parent=buffers.parent.reshape(rows),
            may_address=np.ones((len(node), num), dtype=bool),
            has_turn=np.zeros(len(node), dtype=bool),
        )
"""
OWN = ("--channel", "my_parts:Lossy", "--features", "my_parts:Ages")


@pytest.fixture(scope="module")
def trained(forks, tmp_path_factory):
    """A folder with the parts, and a run that was trained with them in two goes."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "my_parts.py").write_text(PARTS)
    begun = forks.run(folder, "swarm_mj", "train", *SMALL, *OWN, "--out", "run", "--budget", 256)
    assert begun.returncode == 0, begun.stderr
    whole = forks.run(folder, "swarm_mj", "train", *SMALL, *OWN, "--out", "w", "--budget", 512)
    assert whole.returncode == 0, whole.stderr
    return folder


@pytest.fixture
def typed(forks, trained):
    """Runs `swarm-mj` there; also says whether the parts were imported."""

    def run(*arguments):
        (trained / "imported.txt").unlink(missing_ok=True)
        done = forks.run(trained, "swarm_mj", *arguments)
        return done, (trained / "imported.txt").exists()

    return run


def test_the_network_has_as_many_features_as_the_class_names(trained):
    _, config = read_weights(trained / "run")
    assert config.features == "my_parts:Ages"
    assert config.network.num_features == 2


def test_a_run_goes_on_bit_for_bit_if_its_parts_are_named_again(typed, trained):
    done, was_imported = typed("train", "--out", "run", "--resume", "--budget", 512)
    assert done.returncode == 2
    assert not was_imported
    assert "--features my_parts:Ages --channel my_parts:Lossy again" in done.stderr
    done, _ = typed("train", "--out", "run", "--resume", "--budget", 512, *OWN)
    assert done.returncode == 0, done.stderr
    rows = [(trained / name / "curve.csv").read_text().splitlines() for name in ("run", "w")]
    columns = rows[0][0].split(",")
    timed = {i for i, name in enumerate(columns) if "minutes" in name or "per_s" in name}
    kept = [
        [[c for i, c in enumerate(row.split(",")) if i not in timed] for row in each]
        for each in rows
    ]
    assert kept[0] == kept[1]
    ours, its = (read_weights(trained / name)[0] for name in ("run", "w"))
    assert all(np.array_equal(ours[name], its[name]) for name in ours)


FLY = ("fly", "--policy", "w", "--robots", 5, "--windows", 10, "--no-record")


def test_a_policys_features_are_loaded_only_if_its_user_names_them(typed):
    done, was_imported = typed(*FLY)
    assert done.returncode == 2
    assert not was_imported
    assert "add --features my_parts:Ages" in done.stderr
    done, was_imported = typed(*FLY, "--features", "my_parts:Ages")
    assert done.returncode == 0, done.stderr
    assert was_imported


@pytest.mark.parametrize(
    "arguments",
    [
        (*FLY, "--features", "my_parts:Other"),
        ("evaluate", "--policy", "w", "--robots", 5, "--episodes", 1),
        ("train", "--init", "w", "--out", "next", "--robots", 5),
        ("policies", "w"),
    ],
)
def test_a_folder_never_names_what_is_imported(typed, arguments):
    done, was_imported = typed(*arguments)
    assert done.returncode == 2
    assert not was_imported
    assert done.stderr.count("error:") == 1


def test_an_evaluation_loads_them_in_every_process(typed):
    done, _ = typed(
        *("evaluate", "--policy", "w", "tdma", "--features", "my_parts:Ages"),
        *("--robots", 5, "--windows", 10, "--episodes", 2, "--jobs", 2),
    )
    assert done.returncode == 0, done.stderr


def test_a_class_that_has_changed_does_not_fit_the_network(typed, trained):
    changed = PARTS.replace("class Ages", "class Other").replace(
        '("age", "is oneself")', '("age", "is oneself", "third")'
    )
    (trained / "my_other.py").write_text(changed.replace("class Other", "class Ages"))
    weights, config = read_weights(trained / "w")
    save_weights(trained / "other", weights, replace(config, features="my_other:Ages"))
    done, _ = typed("fly", "--policy", "./other", *FLY[3:], "--features", "my_other:Ages")
    assert done.returncode == 2
    assert "was trained on 2 features, and my_other:Ages now has 3" in done.stderr
