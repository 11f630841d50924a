"""What type checkers are told of a mission's fields is what the fields say."""

from dataclasses import fields
from typing import get_type_hints

from swarm_mj.mission import Mission, MissionFields, PresetAndFields, TaskAndFields


def test_type_checkers_are_told_of_every_field_by_its_type():
    """One that is missing is a misspelt keyword to them; a wrong type, a wrong complaint."""
    declared = {spec.name: spec.type for spec in fields(Mission)}
    own = {"preset": declared.pop("preset"), "task": declared.pop("task")}
    told = get_type_hints(MissionFields)
    for name, kind in declared.items():
        assert told.get(name) == kind, f"MissionFields lacks the line `{name}: {kind}`"
    assert list(told) == list(declared), "MissionFields has the fields of Mission, in their order"
    assert get_type_hints(PresetAndFields) == declared | {"preset": own["preset"]}
    assert get_type_hints(TaskAndFields) == declared | {"task": own["task"]}
    assert not MissionFields.__required_keys__
