"""Parts of one's own on the command line, by module:Name: flown, evaluated, trained with.

What a user names is loaded, and nothing else.
"""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from swarm_mj.cli import main
from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.policies.stored import read_weights, save_weights
from swarm_mj.simulation.swarm import Swarm

SMALL = ("--task", "random-walk", "--robots", 5, "--windows", 10, "--range-ratio", 0.5)
PARTS = """
from pathlib import Path

import numpy as np
from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.policies.gnn.graphs import FeatureExtractor, Graphs
from swarm_mj.policies.policy import BroadcastPolicy
from swarm_mj.radio.mission_radio import radio_of

with Path("imported.txt").open("a") as file:
    file.write("once more\\n")

class Coin(BroadcastPolicy):
    def start(self, num_robots, rngs):
        self.stream = Stream(rngs, uniform, (num_robots,))
    def transmits(self, views):
        return self.stream.next() < 0.2

class Lossy:
    def __init__(self, mission):
        self.radio = radio_of(mission)
    def start(self, num_robots, rngs):
        self.stream = Stream(rngs, uniform, (num_robots,))
    def __call__(self, position_m, recipient):
        heard = self.radio(position_m, recipient)
        return np.where(self.stream.next() < 0.5, np.arange(heard.shape[1]), heard)

class Rest:
    cost_name, cost_unit = "mean speed", "m/s"
    def __call__(self, buffers, states):
        return -states.velocity_mps
    def cost(self, states):
        return np.linalg.norm(states.velocity_mps, axis=2).mean(axis=1)

def pillar(spec, mission):
    spec.worldbody.add_geom(name="pillar", size=[9, 9, 9])

def breaks(buffers, states):
    raise RuntimeError("out of order")

calls = []

def wears_out(buffers, states):
    calls.append(len(calls))
    if len(calls) > 10:
        raise RuntimeError("worn out")
    return -states.velocity_mps

def text():
    return "tdma"

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
ALL = ("--channel", "my_parts:Lossy", "--controller", "my_parts:Rest", "--scene", "my_parts:pillar")


@pytest.fixture(autouse=True)
def _parts(tmp_path):
    (tmp_path / "my_parts.py").write_text(PARTS)
    (tmp_path / "imported.txt").touch()


def test_a_flight_with_parts_of_ones_own(succeed, tmp_path):
    fly = ("fly", *SMALL, "--policy", "my_parts:Coin", *ALL)
    done = succeed(*fly, "--json", "a.json", "--record", "a.rrd")
    assert "channel my_parts:Lossy" in done.stdout
    assert "mean speed" in done.stdout
    flown = json.loads((tmp_path / "a.json").read_text())
    assert flown["config"]["policy"] == "my_parts:Coin"
    assert flown["config"]["scene"] == "my_parts:pillar"
    assert flown["task_cost_name"] == "mean speed"
    assert flown["task_cost_last"] == pytest.approx(0.9**9 * flown["task_cost_first"])
    succeed(*fly, "--json", "b.json", "--no-record")
    assert json.loads((tmp_path / "b.json").read_text())["aoi_mean"] == flown["aoi_mean"]


def test_a_flight_over_a_table_of_gains(succeed, tmp_path):
    places = [f"{x},0,{x},{100 + y},-60" for x in (-100, 0, 100) for y in range(3)]
    (tmp_path / "gains.csv").write_text("\n".join(["x1_m,y1_m,x2_m,y2_m,gain_db", *places]))
    done = succeed("evaluate", *SMALL, "--policy", "tdma", "--channel", "table:gains.csv")
    assert "table:gains.csv" in done.stdout


@pytest.mark.slow
def test_an_evaluation_makes_them_in_every_process_and_says_which(succeed, tmp_path):
    evaluate = ("evaluate", *SMALL, *ALL, "--policy", "my_parts:Coin", "mst", "--episodes", 30)
    for name, jobs in (("one", 1), ("two", 2)):
        done = succeed(*evaluate, "--jobs", jobs, "--csv", f"{name}.csv")
    assert (tmp_path / "one.csv").read_bytes() == (tmp_path / "two.csv").read_bytes()
    with (tmp_path / "one.csv").open() as file:
        coin, _ = csv.DictReader(file)
    assert (coin["policy"], coin["channel"]) == ("my_parts:Coin", "my_parts:Lossy")
    assert coin["task_cost_name"] == "mean speed"
    assert coin["published_aoi_mean"] == ""
    assert json.loads(coin["config"])["controller"] == "my_parts:Rest"
    assert "channel my_parts:Lossy" in done.stdout


def test_an_evaluation_goes_on_with_the_same_parts_only(refusal, swarm_mj, tmp_path):
    evaluate = ("evaluate", *SMALL, "--policy", "tdma", "--episodes", 30, "--csv", "r.csv")
    channel = ("--channel", "my_parts:Lossy")
    breaking = ("--controller", "my_parts:wears_out")  # after the first 25 missions
    done = swarm_mj(*evaluate, *channel, *breaking)
    assert done.returncode == 2
    assert "controller my_parts:wears_out raised RuntimeError: worn out (my_par" in done.stderr
    assert "is of another evaluation" in refusal(*evaluate, *channel, "--resume")
    with (tmp_path / "my_parts.py").open("a") as file:
        file.write("# changed\n")
    assert "is of another evaluation" in refusal(*evaluate, *channel, *breaking, "--resume")


@pytest.mark.parametrize("ending", [".csv", ".json"])
def test_a_part_that_fails_at_once_leaves_no_progress(refusal, ending):
    """The progress, with nothing flown, had to be replaced by --force once the part was mended."""
    breaking = ("--controller", "my_parts:breaks", "--policy", "tdma")
    refusal("evaluate", *SMALL, *breaking, "--episodes", 2, ending.replace(".", "--"), f"r{ending}")


UNSOUND = {  # parameters, and what is said of them
    "'x'": "must be a dictionary of numbers by their names, not 'x'",
    "None": "must be a dictionary of numbers by their names, not None",
    "{1: 2}": "must have a text as its name, not 1",
    "{'a': float('nan')}": "parameter a of Odd must be finite, not nan",
    "{'a': float('inf')}": "parameter a of Odd must be finite, not inf",
    "{'a': 2**63}": "must be an integer of 64 bits at most, not one of 65",
    "{'a': 10**400}": "must be an integer of 64 bits at most, not one of 13",
    "{'a': [1]}": "must be a plain number, a text, True or False, not [1]",
}


@pytest.mark.parametrize("parameters", UNSOUND)
def test_parameters_that_no_result_can_hold_are_refused_before_the_work(
    refusal, tmp_path, parameters
):
    """A flight went to its end first, and was lost."""
    with (tmp_path / "my_parts.py").open("a") as file:
        file.write(f"\nclass Odd(Coin):\n    parameters = {parameters}\n")
    for command in ("fly --record a.rrd", "evaluate --json a.json"):
        name, *output = command.split()
        said = refusal(name, *SMALL, *output, "--policy", "my_parts:Odd")
        assert UNSOUND[parameters] in said
    assert UNSOUND[parameters] in refusal("policies", "my_parts:Odd")


def test_the_scene_is_in_the_file(succeed, tmp_path):
    succeed("scene", "--robots", 3, "--scene", "my_parts:pillar")
    assert 'name="pillar"' in (tmp_path / "scene.xml").read_text()


REFUSED = {
    "--policy my_parts:Lossy": "must make a DecentralisedPolicy or a CentralisedPolicy",
    "--policy my_parts:Coin --probability 0.1": "takes no transmission probab",
    "--policy my_parts:Coin --deterministic": "applies to learned policies only",
    "--channel my_parts:text": "must be a function, or an object like one, not 'tdma'",
    "--controller os:getcwd": "must be a function, or an object like one, not '/",
    "--scene my_parts:text": "must be a function, or an object like one, not 'tdma'",
    "--channel your_parts:Lossy": "there is no module your_parts in",
    "--controller my_parts:breaks": "controller my_parts:breaks raised RuntimeError: out",
    "--features my_parts:Coin": "no policy here was trained on the features my_parts:Co",
    "--channel my_parts:Lossy --fading rayleigh --erasure 0.3": (
        "channel my_parts:Lossy takes the place of the mission's own, so fading rayleigh, erasure "
        "0.3 would change nothing; leave out one of them"
    ),
}


@pytest.mark.parametrize("options", REFUSED)
def test_what_is_wrong_with_a_part_is_one_line(refusal, options):
    assert REFUSED[options] in refusal("fly", "--no-record", *SMALL, *options.split())


def test_a_channel_of_ones_own_gives_a_mission_the_same_course_beside_any_other(here):
    (here / "my_parts_too.py").write_text(PARTS)
    mission = paper("random-walk", num_robots=5, range_ratio=0.5)
    ages = []
    for seeds in ([3], [8, 3, 1]):
        swarm = Swarm(mission, seeds, channel="my_parts_too:Lossy")
        policy = make_policy("my_parts_too:Coin", mission)
        ages.append([swarm.step(policy).age_windows[seeds.index(3)] for _ in range(150)])
    np.testing.assert_array_equal(*ages)


NETWORK = """
from pathlib import Path

import torch
from torch import nn

from swarm_mj.policies.gnn.network import Network

with Path("imported.txt").open("a") as file:
    file.write("once more\\n")

class Two(Network):
    memory_size = 1
    def __init__(self, shape):
        super().__init__(shape)
        self.output = nn.Linear(shape.num_features + 1, shape.num_outputs)
    def remember(self, node, parent, owner, memory):
        return memory + node[:, :, 0].mean(dim=1, keepdim=True)
    def forward(self, node, parent, is_wanted=None, memory=None):
        return self.output(torch.cat([node, memory[:, None] * node[:, :, :1]], dim=2))
"""
TRAIN = ("train", "--robots", 5, "--windows", 10, "--range-ratio", 0.6, "--missions", 4)
TRAIN = (*TRAIN, "--held-out", 2, "--evaluate-every", 128, "--latent", 6, "--depth", 2)
OWN = ("--channel", "my_parts:Lossy", "--features", "my_parts:Ages", "--network", "my_network:Two")


@pytest.fixture(scope="module")
def trained(forks, tmp_path_factory):
    """A folder with the parts, a run that was trained with them, and half of such a run."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "my_parts.py").write_text(PARTS)
    (folder / "my_network.py").write_text(NETWORK)
    for out, budget in (("run", 128), ("w", 256)):
        done = forks.run(folder, "swarm_mj", *TRAIN, *OWN, "--out", out, "--budget", budget)
        assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture
def typed(forks, trained):
    """Runs `swarm-mj` there: how it ends, what it complains of, whether parts were imported."""

    def run(*arguments):
        (trained / "imported.txt").unlink(missing_ok=True)
        done = forks.run(trained, "swarm_mj", *arguments)
        return done.returncode, done.stderr, (trained / "imported.txt").exists()

    return run


@pytest.mark.slow
def test_a_run_goes_on_bit_for_bit_if_its_parts_are_named_again(typed, trained):
    code, complaint, was_imported = typed("train", "--out", "run", "--resume", "--budget", 256)
    assert (code, was_imported) == (2, False)
    assert (
        "--features my_parts:Ages --network my_network:Two --channel my_parts:Lossy again"
        in complaint
    )
    ended = typed("train", "--out", "run", "--resume", "--budget", 256, *OWN)
    assert (ended[0], ended[2]) == (0, True), ended
    curves = []
    for name in ("run", "w"):
        with (trained / name / "curve.csv").open() as file:
            rows = list(csv.DictReader(file))
        timed = [column for column in rows[0] if "minutes" in column or "per_s" in column]
        curves.append([row | dict.fromkeys(timed, "") for row in rows])
    assert curves[0] == curves[1]
    (ours, config), (its, _) = (read_weights(trained / name) for name in ("run", "w"))
    assert all(np.array_equal(ours[name], its[name]) for name in ours)
    assert (config.features, config.network.num_features) == ("my_parts:Ages", 2)


FLY = ("fly", "--policy", "w", "--robots", 5, "--windows", 10, "--no-record")


def test_a_policys_features_are_loaded_only_if_its_user_names_them(typed):
    code, complaint, was_imported = typed(*FLY)
    assert (code, was_imported) == (2, False)
    assert "add --features my_parts:Ages" in complaint
    code, complaint, _ = typed(*FLY, "--features", "my_parts:Ages")
    assert code == 2
    assert "add --network my_network:Two" in complaint
    both = ("--features", "my_parts:Ages", "--network", "my_network:Two")
    assert typed(*FLY, *both) == (0, "", True)


@pytest.mark.parametrize(
    "arguments",
    [
        (*FLY, "--features", "my_parts:Other"),
        (*FLY, "--network", "my_network:Two"),
        ("evaluate", "--policy", "w", "--robots", 5, "--episodes", 1),
        ("train", "--init", "w", "--out", "next", "--robots", 5),
        ("policies", "w"),
    ],
)
def test_a_folder_never_names_what_is_imported(typed, arguments):
    code, complaint, was_imported = typed(*arguments)
    assert (code, was_imported) == (2, False)
    assert complaint.count("error:") == 1


@pytest.mark.slow
def test_an_evaluation_loads_them_in_every_process(typed):
    ended = typed(
        *("evaluate", "--policy", "w", "tdma", "--features", "my_parts:Ages"),
        *("--network", "my_network:Two"),
        *("--robots", 5, "--windows", 10, "--episodes", 2, "--jobs", 2),
    )
    assert (ended[0], ended[2]) == (0, True), ended


def test_a_class_that_has_changed_does_not_fit_the_network(typed, trained):
    (trained / "my_other.py").write_text(PARTS.replace('"is oneself")', '"is oneself", "third")'))
    weights, config = read_weights(trained / "w")
    save_weights(trained / "other", weights, replace(config, features="my_other:Ages"))
    options = (*FLY[3:], "--features", "my_other:Ages")
    code, complaint, _ = typed("fly", "--policy", "./other", *options)
    assert code == 2
    assert "was trained on 2 features, and my_other:Ages now has 3" in complaint


ODD = """
import numpy as np
from swarm_mj.policies.tdma import Tdma

class NoPacket(Tdma):
    def packet(self, mission):
        return None

class Single(Tdma):
    @property
    def parameters(self):
        return {"p": np.float32(0.5)}

class Leaves(Tdma):
    def transmits(self, views):
        raise SystemExit(0)

class Stops(Tdma):
    def transmits(self, views):
        next(iter(()))
"""


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("NoPacket", "packet() of NoPacket must return a Packet, not None"),
        ("Single", "parameter p of Single must be a plain number"),
        ("Leaves", "raised SystemExit: 0 ("),
        ("Stops", "raised StopIteration ("),
    ],
)
def test_what_a_policy_of_ones_own_does_wrong_is_said_in_one_line(here, capsys, name, said):
    (here / "odd.py").write_text(ODD)
    flown = ["fly", "--policy", f"odd:{name}", "--no-record", "--robots", "3", "--windows", "3"]
    assert main([*flown, "--json", "x.json"]) == 2
    assert said in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.usefixtures("here")
def test_an_observer_must_be_a_robot(here, capsys):
    flown = ["fly", "--policy", "tdma", "--record", "a.rrd", "--robots", "3", "--windows", "3"]
    assert main([*flown, "--observer", "7"]) == 2
    assert "observer must be from 0 to 2, not 7" in capsys.readouterr().err
    assert not (here / "a.rrd").exists()
