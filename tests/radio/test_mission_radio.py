"""The radio is the mission's: its power, its threshold, its half duplex."""

import numpy as np
import pytest

from swarm_mj.mission import Mission, paper, reference
from swarm_mj.radio.composed import ComposedChannel
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.mission_radio import mission_radio, radio_of


def test_radio_is_the_missions():
    """IV-B: at 250 m, 2.4 GHz, -50 dBm and 1 dB the authors' code sends 39.013025 dBm."""
    radio = radio_of(paper())
    assert 10 * np.log10(radio.power_mw) == pytest.approx(39.013025, abs=1e-6)
    assert radio.noise_mw == pytest.approx(1e-5)
    assert radio.threshold == pytest.approx(10**0.1)
    assert not radio.recipient_hears_while_sending
    assert radio_of(reference()).recipient_hears_while_sending


@pytest.mark.parametrize("preset", [paper, reference])
@pytest.mark.parametrize(
    "numbers",
    [
        {"range_ratio": 0.25},
        {"range_ratio": 1.0},
        {"frequency_hz": 9e8},
        {"noise_dbm": -90.0},
        {"sinr_threshold_db": 10.0},
    ],
)
def test_iv_b_a_lone_packet_decodes_up_to_the_range_and_no_farther(preset, numbers):
    """Whatever the mission's numbers: the power makes up for them. Robot 0 sends, 1 listens."""
    mission = preset(num_robots=2, **numbers)
    for share, decoded in ((1.0 - 1e-9, 0), (1.0 + 1e-9, 1)):
        position_m = np.array([[[0.0, 0.0], [share * mission.range_ratio * 1000.0, 0.0]]])
        heard = radio_of(mission)(position_m, np.array([[1, 1]]))
        assert heard[0, 1] == decoded


BEYOND_FREE_SPACE = (
    {"path_loss": "log-distance"},
    {"path_loss": "two-ray"},
    {"shadowing_db": 6.0},
    {"fading": "rayleigh"},
    {"fading": "rician"},
    {"erasure": 0.1},
    {"burst_begin": 0.02},
    {"high_power_fraction": 0.2},
)


def test_the_papers_missions_have_the_papers_channel():
    assert mission_radio(paper()).channel == radio_of(paper())
    for unused in (
        {"rician_k": 1.0},
        {"burst_end": 0.5},
        {"high_power_fraction": 0.5, "high_power_db": 0.0},
    ):
        assert isinstance(mission_radio(paper(**unused)).channel, FreeSpaceRadio)


@pytest.mark.parametrize("fields", BEYOND_FREE_SPACE)
def test_anything_more_is_a_composed_channel(fields):
    assert isinstance(mission_radio(paper(**fields)).channel, ComposedChannel)


def test_reception_is_as_the_mission_says():
    fields = {"fading": "rician", "rician_k": 7.0, "erasure": 0.2, "burst_begin": 0.03}
    channel = mission_radio(reference(**fields, burst_end=0.4)).channel
    assert isinstance(channel, ComposedChannel)
    assert channel.reception.rician_k == 7.0
    assert channel.reception.erasure == 0.2
    assert (channel.reception.burst_begin, channel.reception.burst_end) == (0.03, 0.4)
    assert channel.reception.recipient_hears_while_sending


def received_mw(mission: Mission, apart_m: float, seed: int = 0):
    """Between robots 0 and 1, which are so far apart, in both directions."""
    channel = mission_radio(mission).channel
    assert isinstance(channel, ComposedChannel)
    channel.start(mission.num_robots, [np.random.default_rng(seed)])
    position_m = np.zeros((1, mission.num_robots, 2))
    position_m[0, 1:, 0] = apart_m
    everyone = np.ones((1, mission.num_robots), dtype=bool)
    powers = channel.gains.received_mw(position_m, np.zeros(1, dtype=int), everyone)
    return powers[0, 0, 1], powers[0, 1, 0]


def test_powers_follow_the_missions_laws():
    """At 200 m: 20 log10(10) + 35 log10(10) dB; h^2 h^2 / d^4 with h = 2 m; 3 dB more."""
    sent_mw = radio_of(paper()).power_mw
    at_20_m = radio_of(paper()).received_at_1_m_mw / 400.0
    log = paper(path_loss="log-distance", loss_exponent=3.5, reference_m=20.0)
    assert received_mw(log, 200.0)[0] == pytest.approx(at_20_m * 10**-3.5)
    two_ray = paper(path_loss="two-ray", antenna_height_m=2.0)
    assert received_mw(two_ray, 800.0)[0] == pytest.approx(sent_mw * 2.0**4 / 800.0**4, rel=1e-3)
    strong = paper(num_robots=4, high_power_fraction=0.25, high_power_db=3.0)
    forth, back = received_mw(strong, 100.0)
    assert forth / back == pytest.approx(10**0.3)


def test_shadowing_is_the_missions_own():
    losses = [received_mw(paper(num_robots=2, shadowing_db=6.0), 200.0, seed) for seed in (1, 1, 2)]
    assert losses[0] == losses[1] != losses[2]
    assert losses[0][0] == pytest.approx(losses[0][1])
