"""The mission's numbers of the channel, what they count with, and values that are not usual."""

from dataclasses import fields

from swarm_mj.mission import Mission
from swarm_mj.mission.labels import CHANNEL
from swarm_mj.system.fields import meaning_of

SPECS = {spec.name: spec for spec in fields(Mission)}
CHANNEL_FIELDS = [name for name, spec in SPECS.items() if meaning_of(spec).group == CHANNEL]
assert CHANNEL_FIELDS  # or laws of each of them would hold of none


def other_values(name):
    """Values of a field besides its default: every other choice, or one between its bounds."""
    spec = SPECS[name]
    about = meaning_of(spec)
    if about.choices:
        return [choice for choice in about.choices if choice != spec.default]
    middle = 0.5 * (about.low + about.high)
    return [int(middle) if isinstance(spec.default, int) else middle]


def counting(name):
    """The fields of a mission in which a number counts, and in which `other_values` are allowed."""
    if name == "sensing_dbm":
        return {"noise_dbm": -100.0}  # which hides no power of those
    switch = meaning_of(SPECS[name]).counts_with
    if switch is None:
        return {}
    return {switch.name: switch.state or other_values(switch.name)[0]}
