"""Users' code, by name: what is loaded, how it is called, and errors in one line."""

import json
import sys

import mujoco
import pytest

from swarm_mj.mission import paper
from swarm_mj.system.user_code import file_of, is_ours, load, make, one_line_each

MISSION = paper(num_robots=3)
PARTS = '''
import json
from functools import partial

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

def given_mission_last(probability, mission):
    made = Needs(mission)
    made.probability = probability
    return made

def given_three(position_m, recipient, range_m):
    return recipient

by_place, by_name = partial(given_mission_last, 0.1), partial(given_mission_last, probability=0.1)
of_a_class = partial(Needless, 0.5)
near = partial(given_three, range_m=9.0)
'''
MODULES = {
    "own_parts": PARTS,
    "own_broken": "x = 1\ndef (:\n",
    "own_needy": "import nowhere_at_all\n",
    "own_quitter": "raise SystemExit(3)\n",
    "own_inner": "def late(position_m, recipient):\n    raise KeyError(1)\n",
    "own_outer": "from own_inner import late\n",
}


@pytest.fixture(autouse=True)
def parts(here):
    """Modules `own_...` in the current folder."""
    path, modules = list(sys.path), set(sys.modules)
    for name, text in MODULES.items():
        (here / f"{name}.py").write_text(text)
    yield here
    sys.path[:] = path
    for name in set(sys.modules) - modules:
        if name.startswith("own_"):
            del sys.modules[name]


@pytest.mark.parametrize(
    ("name", "made_with"),
    [
        ("Needs", {"num_robots": 3}),
        ("MayTake", {"num_robots": 3}),
        ("maker", {"num_robots": 3}),
        ("Needless", {"probability": 0.25}),
        ("of_a_class", {"probability": 0.5}),
        ("by_place", {"num_robots": 3, "probability": 0.1}),
        ("by_name", {"num_robots": 3, "probability": 0.1}),
    ],
)
def test_what_takes_a_mission_is_given_it(name, made_with):
    made = make("controller", f"own_parts:{name}", MISSION)
    assert {key: getattr(made, key) for key in made_with} == made_with


@pytest.mark.parametrize("name", ["plain", "an_object", "near"])
def test_what_takes_two_arguments_is_the_component_itself(name):
    found = make("channel", f"own_parts:{name}", MISSION)
    assert found is getattr(sys.modules["own_parts"], name)


def test_only_the_packages_own_components_get_live_arrays():
    assert is_ours(make("policy", "swarm_mj.policies.tdma:Tdma", MISSION))
    assert not is_ours(load("channel", "own_parts:plain"))


@pytest.mark.parametrize(
    "name", ["foo", "foo:", ":Foo", "a b:C", "a:b:c", "./a/b.py:C", "a:B.c", "a:B(1)", ""]
)
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
        ("own_parts:breaks", r"raised AttributeError: .*no_such_field.* \(own_parts.py, line 32\)"),
        ("own_broken:Any", r"importing it raised SyntaxError: .*own_broken.py, line 2"),
        (
            "own_needy:Any",
            r"raised ModuleNotFoundError: No module named 'nowhere_at_all' \(own_need",
        ),
        ("own_quitter:Any", r"importing it raised SystemExit: 3"),
        ("own_parts.py:Needs", "no module own_parts.py in .*; did you mean own_parts[?]$"),
    ],
)
def test_what_cannot_be_made_is_said_in_one_line(name, complaint):
    with pytest.raises(ValueError, match=complaint) as refused:
        make("channel", name, MISSION)
    assert str(refused.value).startswith(f"channel {name}")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("own_parts:breaks_later", "raised KeyError: 'lost'"),
        ("own_outer:late", "raised KeyError: 1"),
    ],
)
def test_errors_in_flight_name_the_component_even_of_a_module_behind_it(name, said):
    late = make("channel", name, MISSION)
    with pytest.raises(ValueError, match=f"^channel {name} {said}"), one_line_each():
        late(None, None)


def test_errors_of_others_are_left_alone():
    """An object of json's is named; what json raises elsewhere is not its fault."""
    load("channel", "own_parts:decoder")
    with pytest.raises(json.JSONDecodeError), one_line_each():
        json.loads("x")


def test_a_message_of_pybind_is_shortened_to_what_was_wrong(parts):
    (parts / "windy.py").write_text("def make(spec):\n    spec.option.wind = 'x'\n    return spec")
    with pytest.raises(
        ValueError, match="TypeError: incompatible function arguments; Invoked"
    ) as it:
        make("scene", "windy:make", mujoco.MjSpec())
    assert str(it.value).endswith("(windy.py, line 2)")
    assert "The following" not in str(it.value)


def test_the_file_of_loaded_code_is_known(parts):
    assert file_of("own_parts:plain") is None  # so far
    load("channel", "own_parts:plain")
    assert file_of("own_parts:plain") == parts / "own_parts.py"
