"""A mission's channel, controller and scene: by name or as objects, and what is refused."""

import json
import sys

import pytest

from swarm_mj.mission import paper
from swarm_mj.simulation.components import Components, components_in, digest
from swarm_mj.system.user_code import load

MISSION = paper(num_robots=3)
PARTS = '''
class Plain:
    def __call__(self, position_m, recipient):
        """Nothing."""

def plain(position_m, recipient):
    return recipient

def maker(mission):
    return object()

def text():
    return "tdma"

def nothing():
    return None

def given_three(position_m, recipient, range_m):
    return recipient

number = 7
'''


@pytest.fixture(autouse=True)
def parts(here):
    """A module `own_parts` in the current folder."""
    path = list(sys.path)
    (here / "own_parts.py").write_text(PARTS)
    yield here
    sys.path[:] = path
    sys.modules.pop("own_parts", None)


def test_names_become_objects_and_objects_stay():
    def controller(_buffers, states):
        return 0.0 * states.position_m

    made = Components(channel="own_parts:plain", controller=controller).made(MISSION)
    assert made.channel is sys.modules["own_parts"].plain
    assert made.controller is controller
    assert made.scene is None


def test_a_channel_by_name_takes_no_effects_beside_it():
    named = Components(channel="own_parts:plain")
    said = "so fading rayleigh, erasure 0.1 would change nothing; leave out one of them"
    with pytest.raises(ValueError, match=f"^channel own_parts:plain takes the place of .*{said}"):
        named.made(paper(num_robots=3, fading="rayleigh", erasure=0.1))


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("number", "must be a function, or an object like one, not 7"),
        ("maker", "must be a function, or an object like one, not <"),
        ("text", "must be a function, or an object like one, not 'tdma'"),
        ("nothing", "must be a function, or an object like one, not None"),
        ("given_three", r"is called with \(position_m, recipient\), but this one takes"),
    ],
)
def test_components_must_be_functions_or_like_them(name, said):
    with pytest.raises(ValueError, match=rf"^channel own_parts:{name}: a? ?channel {said}"):
        Components(channel=f"own_parts:{name}").made(MISSION)
    assert callable(Components(channel="own_parts:Plain").made(MISSION).channel)


def test_names_are_those_typed_or_of_the_objects():
    components = Components(channel="my:Radio", controller=json.dump, scene=json.JSONDecoder.decode)
    names = {"channel": "my:Radio", "controller": "dump", "scene": "decode"}
    assert components.names == names
    assert components_in(names | {"seed": 3, "policy": "mst"}).given == names
    assert components.title == ", channel my:Radio, controller dump, scene decode"


def test_a_digest_changes_with_the_file(parts):
    load("channel", "own_parts:plain")
    before = digest("own_parts:plain")
    with (parts / "own_parts.py").open("a") as file:
        file.write("\n# another line\n")
    assert digest("own_parts:plain") != before


@pytest.mark.parametrize(
    ("component", "said"),
    [
        ({"controller": lambda states: states}, r"a controller is called with \(buffers, states\)"),
        ({"channel": lambda: 0}, r"a channel is called with \(position_m, recipient\), but"),
        ({"scene": lambda _spec: None}, r"a scene is called with \(spec, mission\)"),
    ],
)
def test_components_that_take_other_arguments_are_refused(component, said):
    with pytest.raises(TypeError, match=said):
        Components(**component)
