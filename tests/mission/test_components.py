"""Users' own parts, by name: what is loaded, how it is called, and what is said if it cannot be."""

import json
import sys
import textwrap

import pytest

from swarm_mj.mission import paper
from swarm_mj.mission.components import (
    Components,
    digest,
    is_ours,
    load,
    make,
    one_line_each,
)

MISSION = paper(num_robots=3)
PARTS = '''
"""Parts."""

import json

class Needs:
    def __init__(self, mission):
        self.num_robots = mission.num_robots

class Needless:
    def __init__(self, probability=0.25):
        self.probability = probability

class MayTake:
    def __init__(self, mission=None):
        self.num_robots = mission.num_robots

def maker(mission):
    return Needs(mission)

def plain(position_m, recipient):
    return recipient

class Plain:
    def __call__(self, spec, mission):
        """Nothing."""

an_object = Plain()
decoder = json.JSONDecoder()
number = 7

def breaks(mission):
    return mission.no_such_field

def breaks_later(position_m, recipient):
    raise KeyError("lost")

from functools import partial

def given_mission_last(probability, mission):
    made = Needs(mission)
    made.probability = probability
    return made

def within(position_m, recipient, range_m):
    return recipient

by_place, by_name = partial(given_mission_last, 0.1), partial(given_mission_last, probability=0.1)
of_a_class = partial(Needless, 0.5)
near = partial(within, range_m=9.0)
'''


@pytest.fixture
def parts(here):
    """A module `own_parts` in the current folder."""
    path, modules = list(sys.path), set(sys.modules)
    (here / "own_parts.py").write_text(textwrap.dedent(PARTS))
    yield here
    sys.path[:] = path
    for name in set(sys.modules) - modules:
        if name.startswith("own_"):
            del sys.modules[name]


@pytest.mark.parametrize("name", ["Needs", "MayTake", "maker"])
@pytest.mark.usefixtures("parts")
def test_what_takes_a_mission_is_given_it(name):
    assert make("controller", f"own_parts:{name}", MISSION).num_robots == 3


@pytest.mark.usefixtures("parts")
def test_what_needs_nothing_is_given_nothing():
    assert make("policy", "own_parts:Needless", MISSION).probability == 0.25


@pytest.mark.parametrize("name", ["plain", "an_object"])
@pytest.mark.usefixtures("parts")
def test_what_takes_two_arguments_is_the_part_itself(name):
    found = make("channel", f"own_parts:{name}", MISSION)
    assert found is getattr(sys.modules["own_parts"], name)


def test_a_part_of_the_package_can_be_named_too():
    from swarm_mj.policies.tdma import Tdma

    assert isinstance(make("policy", "swarm_mj.policies.tdma:Tdma", MISSION), Tdma)


@pytest.mark.parametrize("name", ["foo", "foo:", ":Foo", "a b:C", "a:b:c", "a/b:C", "a:B.c", ""])
def test_another_form_is_refused(name):
    with pytest.raises(ValueError, match="must be named module:Name, such as my_parts:Mine"):
        load("channel", name)


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        (
            "own_part:Needs",
            r"no module own_part in .*, nor among those installed; did you mean own_p",
        ),
        ("own_parts.deeper:Needs", r"no module own_parts.deeper in"),
        ("own_parts:Need", r"own_parts.py has no Need; did you mean Needs\?"),
        ("own_parts:breaks", r"raised AttributeError: .*no_such_field.* \(own_parts.py, line 33\)"),
        ("own_broken:Any", r"importing it raised SyntaxError: .*own_broken.py, line 2"),
        (
            "own_needy:Any",
            r"raised ModuleNotFoundError: No module named 'nowhere_at_all' \(own_need",
        ),
        ("own_quitter:Any", r"importing it raised SystemExit: 3"),
    ],
)
def test_what_cannot_be_made_is_said_in_one_line(parts, name, complaint):
    (parts / "own_broken.py").write_text("x = 1\ndef (:\n")
    (parts / "own_needy.py").write_text("import nowhere_at_all\n")
    (parts / "own_quitter.py").write_text("raise SystemExit(3)\n")
    with pytest.raises(ValueError, match=complaint) as refused:
        make("channel", name, MISSION)
    assert str(refused.value).startswith(f"channel {name}")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("name", ["number", "Plain", "maker"])
@pytest.mark.usefixtures("parts")
def test_parts_must_be_functions_or_like_them(name):
    channel = Components(channel=f"own_parts:{name}")
    if name == "Plain":  # its object is called
        assert callable(channel.made(MISSION).channel)
    else:
        with pytest.raises(ValueError, match="must be a function of two arguments, or make an"):
            channel.made(MISSION)


@pytest.mark.usefixtures("parts")
def test_what_a_part_raises_in_flight_names_it():
    breaks = make("channel", "own_parts:breaks_later", MISSION)
    with (
        pytest.raises(ValueError, match=r"^channel own_parts:breaks_later raised KeyError: 'lost'"),
        one_line_each(),
    ):
        breaks(None, None)


def test_what_others_raise_is_left_alone():
    with pytest.raises(KeyError), one_line_each():
        raise KeyError("ours")


@pytest.mark.usefixtures("parts")
def test_what_a_part_was_made_with_is_no_part():
    """An object of json's is named; what json raises elsewhere is left alone."""
    load("channel", "own_parts:decoder")
    with pytest.raises(json.JSONDecodeError), one_line_each():
        json.loads("x")


def test_a_part_that_the_module_took_from_another_of_ones_own(parts):
    (parts / "own_inner.py").write_text("def late(position_m, recipient):\n    raise KeyError(1)\n")
    (parts / "own_outer.py").write_text("from own_inner import late\n")
    late = make("channel", "own_outer:late", MISSION)
    with pytest.raises(ValueError, match="channel own_outer:late raised"), one_line_each():
        late(None, None)


def test_a_digest_changes_with_the_file(parts):
    load("channel", "own_parts:plain")
    before = digest("own_parts:plain")
    with (parts / "own_parts.py").open("a") as file:
        file.write("\n# another line\n")
    assert digest("own_parts:plain") != before


@pytest.mark.parametrize("name", ["by_place", "by_name"])
@pytest.mark.usefixtures("parts")
def test_a_partial_function_is_given_the_mission_that_it_still_needs(name):
    made = make("policy", f"own_parts:{name}", MISSION)
    assert (made.num_robots, made.probability) == (3, 0.1)


@pytest.mark.usefixtures("parts")
def test_a_partial_class_is_made_and_a_partial_function_of_two_arguments_is_the_part():
    assert make("policy", "own_parts:of_a_class", MISSION).probability == 0.5
    near = make("channel", "own_parts:near", MISSION)
    assert near is sys.modules["own_parts"].near


@pytest.mark.parametrize(
    ("name", "way_out"),
    [
        (
            "csma:Csma(0.3)",
            r"`mine = functools.partial\(Csma, 0.3\)` into csma.py and name csma:mine",
        ),
        ("csma:Csma()", r"`mine = functools.partial\(Csma\)` into csma.py"),
        ("fading.py:Rayleigh", "channel fading.py:Rayleigh: leave out .py: fading:Rayleigh$"),
        ("./sub/fading.py:Rayleigh", "leave out .py: sub.fading:Rayleigh$"),
    ],
)
def test_other_forms_that_one_would_try_are_told_the_right_one(name, way_out):
    with pytest.raises(ValueError, match=way_out):
        load("channel", name)


def test_only_the_packages_own_components_get_live_arrays(parts):  # noqa: ARG001
    from swarm_mj.policies.tdma import Tdma

    assert is_ours(Tdma())
    assert not is_ours(load("channel", "own_parts:plain"))


@pytest.mark.parametrize(
    ("component", "said"),
    [
        ({"controller": lambda states: states}, r"a controller is called with \(buffers, states\)"),
        (
            {"channel": lambda: 0},
            r"a channel is called with \(position_m, recipient\), but .* \(\)",
        ),
        ({"scene": lambda _spec: None}, r"a scene is called with \(spec, mission\)"),
    ],
)
def test_components_that_take_other_arguments_are_refused(component, said):
    with pytest.raises(TypeError, match=said):
        Components(**component)
