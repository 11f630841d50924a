"""The list of policies: what they say of themselves, on the terminal, as JSON, and on the pages."""

import json
import math
import re
import subprocess
import sys
from pathlib import Path

import pytest
from tiny_policies import save_tiny

from swarm_mj.cli import main
from swarm_mj.mission import paper
from swarm_mj.policies.registry import LISTED, POLICIES, make_policy
from swarm_mj.policies.tuning import tuned_probability

ROOT = Path(__file__).parents[2]
MISSION = paper("flocking")
CENTRALISED = {"round-robin", "mst", "greedy-oracle", "lookahead-oracle"}
REQUEST = {"round-robin", "mst", "gnn", "greedy-oracle"}


def printed(capsys, *arguments):
    assert main(["policies", *arguments]) == 0
    return capsys.readouterr().out


def table_rows(page):
    """Rows of the tables of policies on a page, by the head of their columns."""
    head = None
    for line in (ROOT / page).read_text().splitlines():
        cells = [cell.strip().replace("`", "") for cell in line.strip().strip("|").split("|")]
        if cells[0] == "policy":
            head = cells
        elif head and line.startswith("|") and cells[0] in POLICIES:
            yield dict(zip(head, cells, strict=True))
        elif not line.startswith("|"):
            head = None


def test_json_says_of_every_policy_what_it_is(capsys):
    listed = {each["name"]: each for each in json.loads(printed(capsys, "--json"))}
    assert list(listed) == [name for name in POLICIES if name != "planner --payload none"]
    assert {name for name, each in listed.items() if each["is_centralised"]} == CENTRALISED
    assert {name for name, each in listed.items() if each["window"] == "request"} == REQUEST
    carried = {name: each["payload"] for name, each in listed.items()}
    assert carried == {name: LISTED[name].payload_name for name in listed}
    assert carried["planner"] == "snapshots"
    assert all(each["uses"] and each["description"] for each in listed.values())
    for name in ("random-flooding", "mst", "aloha", "csma", "gossip"):
        assert listed[name]["probability"] == tuned_probability(name, MISSION)


@pytest.mark.parametrize(("robots", "planners"), [(40, 7263), (80, 27318)])
def test_every_policy_says_what_its_packets_weigh(capsys, robots, planners):
    """A packet's table of fields adds up to its bytes."""
    buffers = 1 + 1 + robots // 8 + 9 * robots
    for each in json.loads(printed(capsys, "--json", "--robots", str(robots))):
        if each["name"] == "planner":
            assert each["packet_bytes"] == planners
        elif each["payload"] == "none":
            assert each["packet_bytes"] == buffers, each["name"]
        else:
            assert each["packet_bytes"] > buffers, each["name"]
        bits = sum(field["bits"] * field["count"] for field in each["packet_fields"])
        assert math.ceil(bits / 8) == each["packet_bytes"]


def test_packets_and_probabilities_are_those_of_the_mission_named(capsys):
    """Of 367 bytes a slot holds 250, as many entries as fit."""
    assert "250 bytes" in printed(capsys, "gossip", "--bit-rate", "40k")
    named = json.loads(printed(capsys, "aloha", "--json", "--task", "stationary", "--robots", "80"))
    assert named["probability"] == tuned_probability("aloha", paper("stationary", num_robots=80))


def test_the_list_fits_and_has_every_policy(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    shown = printed(capsys)
    assert max(map(len, shown.partition("Packets are")[0].splitlines())) <= 80
    assert "…" not in shown
    rows = [line.split() for line in shown.splitlines()]
    named = {name.partition(" ")[0] for name in POLICIES}
    for name in named:
        (row,) = (words for words in rows if words[:1] == [name])
        size = make_policy(name, MISSION).packet(MISSION).num_bytes
        assert row[-2:] == [f"{size:,}", "B"]


def test_one_policy_is_explained_with_the_way_to_fly_it(capsys, here):
    shown = printed(capsys, "spatial-tdma", "--task", "stationary")
    assert "positions in its buffer" in shown
    assert "TDMA where robots that are far apart share a slot." in shown
    assert "beyond the paper" in shown
    assert re.search(r"beyond the paper\W+nothing", printed(capsys, "random-flooding"))
    assert "fly --policy spatial-tdma --task stationary" in shown
    save_tiny(here / "mine", "local")
    shown = " ".join(printed(capsys, "mine").replace("│", " ").split())
    assert "its buffer, and the packets it sent and received, by a trained graph" in shown
    assert "receptive_field" in shown
    assert "beyond the paper" not in shown  # nobody has listed what it uses
    assert "fly --policy mine" in shown
    for nobody in ("nobody", ""):
        assert main(["policies", nobody]) == 2
        assert f"not {nobody!r}" in capsys.readouterr().err


def test_the_planner_of_few_robots_is_said_to_take_turns(capsys):
    note = "planner flies as tdma in teams of up to 6 robots"
    assert note in printed(capsys, "planner", "--robots", "6")
    assert note not in printed(capsys, "planner", "--robots", "7")
    assert note not in printed(capsys, "tdma", "--robots", "6")


@pytest.mark.parametrize("task", ["flocking", "stationary"])
def test_what_policies_say_of_themselves_names_no_file(capsys, task):
    for robots in ("6", "40"):
        listed = printed(capsys, "--json", "--task", task, "--robots", robots)
        assert ".py" not in listed


OWN = """
from swarm_mj import BroadcastPolicy
from swarm_mj.policies import FEW_BYTES, About, Information, Look, Payload
from swarm_mj.protocol.packets import PacketField

class Quiet(BroadcastPolicy):
    '''Robots say little.'''

    uses = "hardly anything"
    payload = "a word"

    def transmits(self, views):
        return views.silence == 0

class Whole(Quiet):
    '''Robots say it all.'''

    about = About(
        uses="the clock alone",
        beyond=(Information.CLOCK, Information.AREA),
        payload=Payload(name="charge", meaning="how full each battery is"),
        look=Look(label="by charge", colour="#117733", marker="x"),
        memory=FEW_BYTES,
    )

    def payload_fields(self, mission):
        return (PacketField(name="charge", bits=8),)

class Mute(BroadcastPolicy):
    def transmits(self, views):
        return views.silence < 0
"""


def test_a_users_own_policy_says_of_itself_what_it_declares(capsys, here, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    (here / "own_of_this_test.py").write_text(OWN)
    shown = printed(capsys, "own_of_this_test:Whole")
    assert re.search(r"what it uses\W+the clock alone\W", shown)
    assert re.search(r"beyond the paper\W+clock, area\W", shown)
    assert "charge: how full each battery is" in shown
    assert "368 bytes" in shown
    shown = printed(capsys, "own_of_this_test:Quiet")
    assert re.search(r"what it uses\W+hardly anything\W", shown)
    assert re.search(r"beyond the paper\W+it does not say: give its class an `about`", shown)
    assert "a word" in shown
    assert "it does not say: give its class a text `uses`" in printed(
        capsys, "own_of_this_test:Mute"
    )
    said = json.loads(printed(capsys, "own_of_this_test:Mute", "--json"))
    assert (said["uses"], said["beyond_paper"], said["payload"]) == ("", None, "none")


def test_the_readme_says_what_packets_carry():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([^`]+)`( \(larger packets\))? \|", text, re.MULTILINE)
    assert len(rows) >= 6
    for policy, is_larger in rows:
        has_payload = make_policy(policy, MISSION).payload != "none"
        assert bool(is_larger) == has_payload, policy


def test_the_list_is_printed_without_torch():
    """Its import takes longer than all the rest."""
    code = (
        "import sys; from swarm_mj.cli import main; main(['policies']); "
        "print('gnn is there', 'torch' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "\ngnn " in done.stdout
    assert done.stdout.endswith("gnn is there False\n")
