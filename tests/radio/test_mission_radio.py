"""The radio is the mission's: its power, its threshold, its half duplex."""

import numpy as np
import pytest

from swarm_mj.mission import paper, reference
from swarm_mj.radio.mission_radio import radio_of


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
