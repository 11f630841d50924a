"""What policies say of themselves: all of it, once, and under names of their own."""

import sys
from dataclasses import MISSING, fields, replace
from types import ModuleType

import pytest

import swarm_mj.policies
from swarm_mj.mission import paper
from swarm_mj.policies.about import (
    FEW_BYTES,
    About,
    Information,
    Listed,
    Look,
    PairMemory,
    Payload,
    VariantOf,
)
from swarm_mj.policies.planner.policy import Planner
from swarm_mj.policies.planner.resting import WITH_LINKS, RestingPlanner
from swarm_mj.policies.policy import BroadcastPolicy, Policy
from swarm_mj.policies.random_access import RandomTransmission
from swarm_mj.policies.registry import (
    CLASSES,
    LISTED,
    POLICIES,
    about_of,
    by_name,
    make_policy,
    policy_classes,
)
from swarm_mj.policies.tdma import Tdma

CHARGE = About(
    uses="its own charge",
    beyond=(Information.CLOCK,),
    payload=Payload(name="charge", meaning="how full each robot's battery is"),
    look=Look(label="by $charge$", colour="#117733", marker="x"),
    memory=PairMemory(bytes_per_pair=100.0),
)


class ByCharge(BroadcastPolicy):
    """Robots with much charge transmit."""

    about = CHARGE

    def transmits(self, views):
        return views.silence == 0


@pytest.fixture
def mine(monkeypatch):
    """The name of a policy of a user's own, in a module that is loaded."""
    module = ModuleType("mine_of_this_test")
    module.ByCharge = ByCharge
    monkeypatch.setitem(sys.modules, module.__name__, module)
    return f"{module.__name__}:ByCharge"


def test_nothing_that_a_policy_says_of_itself_has_a_default():
    assert all(each.default is MISSING for each in fields(Listed))
    assert all(each.default_factory is MISSING for each in fields(Listed))


@pytest.mark.parametrize("kind", list(policy_classes()))
def test_every_class_says_all_of_itself(kind):
    about = kind.about
    assert CLASSES[about.name] is kind
    assert about.uses
    assert not about.uses.endswith(".")
    assert len(about.beyond) == len(set(about.beyond))
    summary, _, _ = kind.__doc__.partition("\n")
    assert summary.endswith(".")
    assert kind.payload == about.payload_name
    # Fields without a name and a meaning, or the other way round, would be carried in silence.
    rest = paper("stationary", num_robots=8)
    assert bool(make_policy(about.name, rest).payload_fields(rest)) == (about.payload is not None)
    makes = kind.with_probability if issubclass(kind, RandomTransmission) else kind.for_mission
    assert makes.__func__ is not Policy.for_mission.__func__


def test_names_places_in_lists_and_classes_are_told_apart():
    assert list(LISTED) == list(POLICIES)
    ranks = [about.rank for about in LISTED.values()]
    assert ranks == sorted(set(ranks))
    assert set(CLASSES) == set(POLICIES) - {"gnn"}
    others = [about.origin.policy for about in LISTED.values() if type(about.origin) is VariantOf]
    assert set(others) <= set(POLICIES)


def test_a_class_without_its_facts_is_named():
    class Silent(BroadcastPolicy):
        def transmits(self, views):
            return views.silence < 0

    with pytest.raises(TypeError, match=r"Silent in \S*test_about must declare what it is"):
        by_name([Tdma, Silent])
    Silent.about = replace(Tdma.about, rank=85)
    with pytest.raises(TypeError, match=r"Silent in .* has the name of another policy, tdma"):
        by_name([Tdma, Silent])
    Silent.about = replace(Tdma.about, name="silent")
    with pytest.raises(TypeError, match=r"Silent in .* has the rank of tdma, 80"):
        by_name([Tdma, Silent])
    Silent.about = replace(Tdma.about, name="silent", rank=85)
    assert by_name([Tdma, Silent]) == {"tdma": Tdma, "silent": Silent}


NEW_FILE = """
from swarm_mj.policies.about import FEW_BYTES, Listed, Look, Textbook
from swarm_mj.policies.policy import BroadcastPolicy

class Silent(BroadcastPolicy):
    about = Listed(
        name="silent",
        origin=Textbook(source="nobody"),
        rank=5,
        uses="nothing",
        beyond=(),
        payload=None,
        look=Look(label="silent", colour="#117733", marker="x"),
        memory=FEW_BYTES,
    )

    def transmits(self, views):
        return views.silence < 0
"""


def test_a_new_file_is_found_without_any_other_change(tmp_path, monkeypatch):
    (tmp_path / "gnn_or_not.py").write_text(NEW_FILE)
    folders = [*swarm_mj.policies.__path__, str(tmp_path)]
    monkeypatch.setattr(swarm_mj.policies, "__path__", folders)
    found = by_name(policy_classes())
    assert set(found) == {*CLASSES, "silent"}
    del sys.modules["swarm_mj.policies.gnn_or_not"]


def test_a_subclass_speaks_for_itself_and_sends_what_its_base_does():
    class Mine(Planner):
        pass

    assert Mine.about is None
    assert Mine.payload == "snapshots"
    with pytest.raises(TypeError, match="about of Wrong must be an About, not 'a text'"):
        type("Wrong", (Tdma,), {"about": "a text"})


def test_the_planner_at_rest_says_what_it_sends_there():
    rest = paper("stationary", num_robots=8)
    assert RestingPlanner(rest).about is RestingPlanner.about
    planner = make_policy("planner", rest)
    assert (planner.about, planner.payload) == (WITH_LINKS, "links")
    assert WITH_LINKS.look == LISTED["planner"].look


def test_a_users_own_policy_is_known_where_it_is_loaded(mine):
    assert about_of(mine) is CHARGE
    assert about_of("never_loaded_here:Mine") is None
    assert about_of("never_loaded_here") is None
    assert "never_loaded_here" not in sys.modules


@pytest.mark.parametrize("name", LISTED)
def test_figures_call_a_policy_as_it_is_typed(name):
    assert LISTED[name].look.label == name


def test_memory_is_that_of_the_class():
    mission = paper("random-walk", num_robots=10, num_windows=16)
    rest = paper("stationary", num_robots=10, num_windows=16)
    assert LISTED["planner"].memory.of(mission) == 250.0 + 4.0 * 10
    assert LISTED["planner"].memory.of(rest) == 250.0
    assert LISTED["sotdma"].memory.of(mission) == 230.0
    assert LISTED["sotdma"].memory.of(replace(mission, num_windows=15)) == 0.0
    assert FEW_BYTES.of(mission) == 0.0


@pytest.mark.parametrize("colour", ["#12345", "#1234567", "red", "#ABCDEF", ""])
def test_a_misspelt_colour_is_refused(colour):
    with pytest.raises(ValueError, match="colour of mine must be # and six digits"):
        Look(label="mine", colour=colour, marker="o")
