"""The radio is the mission's; beliefs and true links against laws and how often packets decode."""

import math
from typing import get_args

import numpy as np
import pytest
from antennas import links_db, write_rover
from scipy.stats import norm
from walls import walls

from swarm_mj.mission import Mission, paper, reference
from swarm_mj.mission.knowledge import Knowable
from swarm_mj.radio.composed import ComposedChannel
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.links import links_between, lone_probabilities
from swarm_mj.radio.mission_radio import TrueLinks, mission_radio, radio_of


def test_radio_is_the_missions():
    """IV-B: at 250 m, 2.4 GHz, -50 dBm and 1 dB the authors' code sends 39.013025 dBm."""
    radio = radio_of(paper())
    assert 10 * np.log10(radio.power_mw) == pytest.approx(39.013025, abs=1e-6)
    assert radio.noise_mw == pytest.approx(1e-5)
    assert radio.threshold == pytest.approx(10**0.1)
    assert not radio.recipient_hears_while_sending
    assert not paper().recipient_hears_while_sending
    assert reference().recipient_hears_while_sending
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
    powers = channel.received_mw(position_m, np.zeros(1, dtype=int), everyone)
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


WALL = walls(0.1, 0)  # 10 dB, between x < 0 and x > 0
ON_A_LINE_M = np.array([[-100.0, 0.0], [-20.0, 0.0], [100.0, 0.0]])


def chances(position_m=ON_A_LINE_M, *, obstacles=None, **fields):
    """What the robots of such a mission believe that lone packets decode with."""
    belief = mission_radio(paper(num_robots=len(position_m), **fields), obstacles).belief
    return lone_probabilities(belief.links(position_m))


@pytest.mark.parametrize(
    "fields",
    [
        {"fading": "rayleigh", "shadowing_db": 6.0, "path_loss": "two-ray", "erasure": 0.5},
        {"fading": "rayleigh", "prior_knowledge": "map"},  # there is nothing on it
        {"prior_knowledge": "statistics"},  # are those of free space
        {"prior_knowledge": "map,statistics,start"},
    ],
)
def test_without_knowledge_belief_is_free_space_to_the_last_digit(fields):
    position_m, spread_m = ON_A_LINE_M, np.array([0.0, 10.0, 20.0])
    is_known = np.array([True, True, False])
    belief = mission_radio(paper(num_robots=3, **fields)).belief
    expected = links_between(radio_of(paper()), position_m, spread_m, is_known)
    for mine, its in zip(belief.links(position_m, spread_m, is_known), expected, strict=True):
        np.testing.assert_array_equal(mine, its)


@pytest.mark.parametrize("known", get_args(Knowable))
def test_only_who_knows_the_map_expects_a_wall(known):
    """Its 10 dB are as much as a factor of 3.2 in distance: 120 and 200 m are too far then."""
    linked = chances(
        obstacles=WALL, prior_knowledge=known, path_loss="log-distance", reference_m=900.0
    )
    through = [linked[0, 2], linked[2, 0], linked[1, 2], linked[2, 1]]
    assert through == ([0.0] * 4 if known == "map" else [1.0] * 4)
    assert linked[0, 1] == linked[1, 0] == 1.0


def test_rayleigh_outage_by_its_law():
    """A lone packet just decodes at 250 m: P = exp(-(d / 250 m)²), times what is not lost.

    Bursts take 0.02 / (0.02 + 0.06) of the slots.
    """
    fields = {"fading": "rayleigh", "erasure": 0.3, "burst_begin": 0.02, "burst_end": 0.06}
    probability = chances(prior_knowledge="statistics", **fields)
    for i, j, apart_m in ((0, 1, 80.0), (1, 2, 120.0), (2, 0, 200.0)):
        expected = 0.7 * 0.75 * math.exp(-((apart_m / 250.0) ** 2))
        assert probability[i, j] == pytest.approx(expected, abs=2e-3)


def test_losses_alone_leave_their_share():
    """In silence and without fades every packet within 250 m is strong enough."""
    probability = chances(prior_knowledge="statistics", erasure=0.3)
    assert probability[~np.eye(3, dtype=bool)] == pytest.approx(0.7)


def test_unknown_shadowing_is_doubt_by_its_law():
    probability = chances(prior_knowledge="statistics", shadowing_db=6.0)
    for i, j, apart_m in ((0, 1, 80.0), (1, 2, 120.0), (2, 0, 200.0)):
        margin_db = 20.0 * math.log10(250.0 / apart_m)
        assert probability[i, j] == pytest.approx(norm.cdf(margin_db / 6.0), abs=5e-3)


def test_strong_radios_are_known_by_their_statistics():
    """12 dB more are as much as a factor of 4 in distance, in one direction."""
    far_m = np.array([[0.0, 0.0], [900.0, 0.0]])
    fields = {"high_power_fraction": 0.5, "high_power_db": 12.0}
    assert chances(far_m, prior_knowledge="statistics", **fields).tolist() == [
        [0.0, 1.0],
        [0.0, 0.0],
    ]
    assert not np.any(chances(far_m, prior_knowledge="map", **fields))


def test_who_is_unknown_is_not_counted_on_by_any_law():
    belief = mission_radio(
        paper(num_robots=3, path_loss="two-ray", prior_knowledge="statistics")
    ).belief
    links = belief.links(ON_A_LINE_M, np.zeros(3), np.array([True, True, False]))
    assert links.received_mw[0, 1] > 0.0
    assert not np.any(links.received_mw[2])
    assert not np.any(links.received_mw[:, 2])


def test_an_error_of_distance_weighs_more_where_power_falls_more_steeply():
    """At 100 m, known to sqrt(2) 5 m: with d⁻⁴ beyond 20 m that counts twice."""
    fields = {"path_loss": "log-distance", "loss_exponent": 4.0, "reference_m": 20.0}
    belief = mission_radio(paper(num_robots=3, prior_knowledge="statistics", **fields)).belief
    position_m = np.array([[0.0, 0.0], [10.0, 0.0], [100.0, 0.0]])
    over_std = belief.links(position_m, np.full(3, 5.0)).distance_over_std
    assert over_std[0, 1] == pytest.approx(10.0 / (5.0 * math.sqrt(2.0)))
    assert over_std[0, 2] == pytest.approx(100.0 / (5.0 * math.sqrt(2.0)) / 2.0)


FADING = {"fading": "rician", "rician_k": 2.0, "shadowing_db": 6.0, "erasure": 0.2}
LOSSES = {
    "path_loss": "log-distance",
    "high_power_fraction": 0.5,
    "burst_begin": 0.05,
    "burst_end": 0.2,
}


@pytest.mark.parametrize("fields", [{"shadowing_db": 6.0}, FADING, FADING | LOSSES])
def test_true_links_decode_as_often_as_the_channel_lets_them(fields):
    """Each robot in turn sends alone in every slot of so many; behind the wall, too."""
    mission, num_slots = paper(num_robots=4, **fields), 4000
    channel = mission_radio(mission, WALL).channel
    channel.start(4, [np.random.default_rng(seed) for seed in (1, 2)])
    position_m = np.array([[-90.0, 0.0], [-20.0, 60.0], [60.0, 0.0], [90.0, 30.0]])
    links = TrueLinks(radio=radio_of(mission), channel=channel).links(position_m, 1)
    expected = lone_probabilities(links)
    places_m = np.broadcast_to(position_m, (num_slots, 4, 2)).copy()
    in_slots = channel.at(np.arange(num_slots), np.ones(num_slots, dtype=int))
    for i in range(4):
        recipient = np.tile(np.where(np.arange(4) == i, -1, np.arange(4)), (num_slots, 1))
        often = np.mean(in_slots(places_m, recipient) == i, axis=0)
        others = np.arange(4) != i
        np.testing.assert_allclose(often[others], expected[i, others], atol=0.04)


@pytest.mark.parametrize(("offset_m", "behind_wall"), [(0.0, (0, 1)), (50.0, (1, 2))])
def test_a_map_that_is_wrong_shows_obstacles_east_of_their_places(offset_m, behind_wall):
    """The wall of 10 dB stands at x = 0, and on the other map at 50 m."""
    position_m = np.array([[-20.0, 0.0], [20.0, 0.0], [80.0, 0.0]])
    mission = paper(num_robots=3, prior_knowledge="map", map_offset_m=offset_m)
    radio = mission_radio(mission, WALL)
    for i, j in ((0, 1), (1, 2)):
        squared_m2 = np.sum((position_m[i] - position_m[j]) ** 2)
        free_mw = radio.belief.radio.received_at_1_m_mw / squared_m2
        loss = 0.1 if (i, j) == behind_wall else 1.0
        believed_mw = radio.belief.links(position_m).received_mw[i, j]
        assert believed_mw == pytest.approx(loss * free_mw)


@pytest.mark.parametrize("known", ["nothing", "map", "statistics", "map,statistics"])
def test_everyone_knows_how_far_positions_err(known):
    """Of two robots 100 m apart that err by 3 m each, 4 m more in the snapshot of one of them."""
    fields = {"fading": "rayleigh", "prior_knowledge": known, "position_noise_m": 3.0}
    belief = mission_radio(paper(num_robots=2, **fields), WALL).belief
    position_m = np.array([[10.0, 0.0], [110.0, 0.0]])
    over_std = belief.links(position_m).distance_over_std
    assert over_std[0, 1] == pytest.approx(100.0 / math.hypot(3.0, 3.0))
    over_std = belief.links(position_m, np.array([4.0, 0.0])).distance_over_std
    assert over_std[0, 1] == pytest.approx(100.0 / math.hypot(5.0, 3.0))


IN_SPACE_M = np.array([[0.0, 0.0, 20.0], [60.0, 0.0, 25.0], [0.0, 80.0, 0.1], [30.0, 90.0, 0.1]])
IS_ROVER = (False, False, True, True)


def mixed_team(tmp_path, **fields):
    """Two quadrotors without antennas of their own, and two rovers with them."""
    robot = f"quadrotor:2,{write_rover(tmp_path)}:2"
    return paper(num_robots=4, robot=robot, **fields)


@pytest.mark.parametrize("knows", ["nothing", "statistics"])
def test_antennas_by_robot_type_against_a_loop(tmp_path, knows):
    """Free space between antennas, in dB; only who knows the statistics believes in them."""
    mission = mixed_team(tmp_path, prior_knowledge=knows)
    made = mission_radio(mission)
    made.channel.start(4, [np.random.default_rng(1)])
    true_mw = made.truth.links(IN_SPACE_M, 0).received_mw
    believed_mw = made.belief.links(IN_SPACE_M).received_mw
    at_1_m_dbm = 10.0 * math.log10(radio_of(mission).received_at_1_m_mw)
    for (i, j), (budget_db, apart_m) in links_db(IN_SPACE_M, IS_ROVER).items():
        expected_mw = 10 ** ((at_1_m_dbm + budget_db - 20.0 * math.log10(apart_m)) / 10.0)
        assert true_mw[i, j] == pytest.approx(expected_mw)
        if knows == "nothing":
            apart_m = np.linalg.norm(IN_SPACE_M[i] - IN_SPACE_M[j])
            expected_mw = radio_of(mission).received_at_1_m_mw / apart_m**2
        assert believed_mw[i, j] == pytest.approx(expected_mw)


def test_the_channel_decodes_by_the_antennas(tmp_path):
    """At 400 m twice 6 dB, less 3 dB, are more than the 4.1 dB beyond the range of 250 m."""
    mission = mixed_team(tmp_path)
    channel = mission_radio(mission).channel
    channel.start(4, [np.random.default_rng(1)])
    position_m = np.zeros((1, 4, 3))
    position_m[0, :, 0] = [0.0, 400.0, 5000.0, 5400.0]
    slot, everyone = np.zeros(1, dtype=int), -1
    heard = channel.at(slot, slot)(position_m, np.array([[everyone, 1, everyone, 3]]))
    assert heard.tolist() == [[0, 1, 2, 2]]


@pytest.mark.parametrize("robot", ["point", "quadrotor", "rover"])
def test_without_declarations_or_with_antennas_that_are_alike_the_radio_is_the_papers(robot):
    mission = paper(num_robots=4, robot=robot)
    assert mission_radio(mission).channel == radio_of(mission)


def test_antennas_that_are_alike_count_where_heights_do():
    """The rover's stands 0.25 m above the floor: two-ray from 4 pi 0.25² / lambda on."""
    mission = paper(num_robots=2, robot="rover", path_loss="two-ray")
    truth = mission_radio(mission).truth
    truth.channel.start(2, [np.random.default_rng(1)])
    position_m = np.array([[0.0, 0.0, 0.125], [50.0, 0.0, 0.125]])
    wavelength_m = 299_792_458.0 / mission.frequency_hz
    breakpoint_m = 4.0 * math.pi * 0.25**2 / wavelength_m
    free_mw = radio_of(mission).received_at_1_m_mw / 50.0**2
    expected_mw = free_mw * (breakpoint_m / 50.0) ** 2
    assert truth.mean_powers_mw(position_m, 0)[0, 1] == pytest.approx(expected_mw)
