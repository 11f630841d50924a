"""The radio in words: what titles and tables say of a mission's channel."""

from swarm_mj.mission import PRESETS, WORLDS, Mission
from swarm_mj.mission.knowledge import NOTHING
from swarm_mj.radio.effects import beyond_free_space
from swarm_mj.system.fields import as_typed

# What else differs from the paper's radio, or from positions that are exact, in a title's order.
# A test holds that a title names every number of the channel that counts.
NAMED_IF_UNUSUAL = (
    "sinr_threshold_db",
    "noise_dbm",
    "sensing_dbm",
    "sensing_gain_db",
    "sensing_miss",
    "sensing_false_alarm",
    "minislots",
    "minislot_us",
    "map_offset_m",
    "position_noise_m",
    "position_noise_s",
)


def radio_in_words(mission: Mission) -> str:
    """Return what differs from the paper's radio and positions, in words; empty if nothing does."""
    usual = Mission()
    words: list[str] = []
    beyond = beyond_free_space(mission)
    if beyond:
        words.append(beyond)
    for name in NAMED_IF_UNUSUAL:
        value = getattr(mission, name)
        if value != getattr(usual, name):
            words.append(f"{name} {as_typed(value)}")
    return ", ".join(words)


def where_flown(mission: Mission) -> list[str]:
    """Return arena, channel, prior knowledge and bit rate in words; a world by its preset."""
    where: list[str] = []
    usual = Mission()
    if mission.preset in WORLDS:
        usual = PRESETS[mission.preset]()
        where.append(f"preset {mission.preset}")
    if mission.arena != usual.arena:
        where.append(f"arena {mission.arena}")
    radio = radio_in_words(mission)
    if radio != radio_in_words(usual):
        where.append(radio or "free space")
    if mission.prior_knowledge != NOTHING:
        where.append(f"prior knowledge {mission.prior_knowledge}")
    if mission.bit_rate is not None:
        where.append(bits_per_second(mission.bit_rate))
    return where


def bits_per_second(rate: float) -> str:
    """Return a bit rate in words, by the usual prefix."""
    for prefix, unit in (("G", 1e9), ("M", 1e6), ("k", 1e3)):
        if rate >= unit:
            return f"{rate / unit:.4g} {prefix}bit/s"
    return f"{rate:.4g} bit/s"
