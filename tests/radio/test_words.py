"""Where a mission is flown, in words."""

from swarm_mj.mission import PRESETS, paper
from swarm_mj.radio.words import bits_per_second, where_flown


def test_where_a_world_is_flown_names_only_what_was_changed():
    assert where_flown(PRESETS["urban"]()) == ["preset urban"]
    assert where_flown(PRESETS["urban"](arena="forest")) == ["preset urban", "arena forest"]
    free = {"path_loss": "free-space", "shadowing_db": 0.0}
    for given, said in (
        (free, "fading rician, rician_k 8"),
        (free | {"fading": "none"}, "free space"),
    ):
        assert ", ".join(where_flown(PRESETS["urban"](**given))) == f"preset urban, {said}"


def test_errors_of_positions_are_said_where_they_are_flown():
    noisy = paper(position_noise_m=5.0, position_noise_s=2.0)
    assert where_flown(noisy) == ["position_noise_m 5, position_noise_s 2"]


def test_rates_are_said_with_the_usual_prefix():
    said = [bits_per_second(rate) for rate in (12.0, 250e3, 1.5e6, 6e9)]
    assert said == ["12 bit/s", "250 kbit/s", "1.5 Mbit/s", "6 Gbit/s"]
