"""A channel from a table of gains: what it says at its pairs of places, and between them."""

import hashlib
import math

import numpy as np
import pytest
from antennas import links_db, write_rover

from swarm_mj.mission import paper
from swarm_mj.radio.gain_table import HEADER, GainTable
from swarm_mj.radio.mission_radio import mission_radio, radio_of
from swarm_mj.simulation.components import Components, digest
from swarm_mj.simulation.swarm import Swarm

LIGHT_MPS = 299_792_458.0
MISSION = paper("stationary", num_robots=12)
HALF_M = MISSION.half_side_m
EVERYONE = -1


def drawn_places(number, seed):
    return np.random.default_rng(seed).uniform(-HALF_M, HALF_M, (number, 4))


def friis_db(ends_m):
    """The gain of free space [dB]."""
    apart_m = np.hypot(ends_m[:, 0] - ends_m[:, 2], ends_m[:, 1] - ends_m[:, 3])
    return 20.0 * np.log10(LIGHT_MPS / (4.0 * math.pi * apart_m * MISSION.frequency_hz))


def crossing_loss_db(ends_m):
    """20 dB between two places on different sides of a wall at x = 0."""
    return np.where(ends_m[:, 0] * ends_m[:, 2] < 0.0, 20.0, 0.0)


@pytest.fixture
def table(tmp_path):
    def channel_of(ends_m, gain_db):
        path = tmp_path / "gains.csv"
        rows = np.column_stack([ends_m, gain_db])
        np.savetxt(path, rows, delimiter=",", header=HEADER, comments="", fmt="%.10g")
        channel = GainTable(MISSION, path)
        assert isinstance(Components(channel=f"table:{path}").made(MISSION).channel, GainTable)
        channel.start(MISSION.num_robots, [np.random.default_rng(0)])
        return channel

    return channel_of


def gains_db(channel, ends_m):
    """The gains of links [dB], which are those of both directions."""
    found = []
    for ends in ends_m:
        position_m = np.tile(ends.reshape(2, 2), (MISSION.num_robots // 2, 1))
        received_mw = channel.mean_powers_mw(position_m, 0)
        assert received_mw[0, 1] == pytest.approx(received_mw[1, 0], rel=1e-9)
        found.append(10.0 * math.log10(received_mw[0, 1] / radio_of(MISSION).power_mw))
    return np.array(found)


def test_a_table_of_free_space_is_free_space_to_a_tenth_of_a_db(table):
    known, asked = drawn_places(100, seed=1), drawn_places(50, seed=2)
    channel = table(known, friis_db(known))
    np.testing.assert_allclose(gains_db(channel, asked), friis_db(asked), atol=0.1, rtol=0.0)


def test_at_its_own_pairs_of_places_a_table_says_what_stands_in_it(table):
    known = drawn_places(60, seed=3)
    gain_db = np.random.default_rng(4).uniform(-110.0, -50.0, 60)
    found_db = gains_db(table(known, gain_db), known)
    np.testing.assert_allclose(found_db, gain_db, atol=0.01, rtol=0.0)


def test_between_its_pairs_a_table_takes_the_losses_of_the_nearest(table):
    """A wall at x = 0, behind which 20 dB are lost."""
    known = drawn_places(4000, seed=5)
    channel = table(known, friis_db(known) - crossing_loss_db(known))
    asked = drawn_places(200, seed=6)
    asked = asked[(np.abs(asked[:, 0]) > 150.0) & (np.abs(asked[:, 2]) > 150.0)]
    lost_db = friis_db(asked) - gains_db(channel, asked)
    assert len(asked) > 20
    np.testing.assert_allclose(lost_db, crossing_loss_db(asked), atol=4.0, rtol=0.0)


def test_slots_of_one_mission_side_by_side_lose_no_more_than_one_alone(table):
    """As credits replay a slot: many rows of the same mission, of other senders."""
    known = drawn_places(60, seed=3)
    channel = table(known, friis_db(known) - 10.0)
    rows = np.zeros(3, dtype=int)
    everyone = np.ones((3, MISSION.num_robots), dtype=bool)
    place_m = np.random.default_rng(9).uniform(-HALF_M, HALF_M, (1, MISSION.num_robots, 2))
    alone_mw = channel.received_mw(place_m, rows[:1], everyone[:1]).copy()
    together_mw = channel.received_mw(np.repeat(place_m, 3, axis=0), rows, everyone)
    np.testing.assert_array_equal(together_mw, alone_mw)


def test_eq4_receptions_over_a_table_of_free_space_are_those_of_free_space(table):
    known = drawn_places(100, seed=7)
    channel = table(known, friis_db(known))
    rng, identity = np.random.default_rng(8), np.arange(MISSION.num_robots)
    first = np.zeros(1, dtype=int)
    for _ in range(30):
        position_m = rng.uniform(-HALF_M, HALF_M, (1, MISSION.num_robots, 2))
        recipient = np.where(rng.random((1, MISSION.num_robots)) < 0.2, EVERYONE, identity)
        heard = channel.at(first, first)(position_m, recipient)
        np.testing.assert_array_equal(heard, radio_of(MISSION)(position_m, recipient))


def test_oracles_know_the_links_of_a_table_and_teams_are_connected_over_it(table, tmp_path):
    known = drawn_places(100, seed=9)
    table(known, friis_db(known) + 40.0)
    name = f"table:{tmp_path / 'gains.csv'}"
    swarm = Swarm(MISSION, [1], channel=name)
    position_m = swarm.states.position_m[0]
    stronger_mw = swarm.truth.links(position_m, 0).received_mw
    free_mw = mission_radio(MISSION).truth.links(position_m, 0).received_mw
    off = ~np.eye(MISSION.num_robots, dtype=bool)
    np.testing.assert_allclose(stronger_mw[off] / free_mw[off], 1e4, rtol=1e-3)
    assert swarm.truth.channel is swarm.channel
    assert digest(name) == hashlib.sha256((tmp_path / "gains.csv").read_bytes()).hexdigest()[:12]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x,y\n1,2\n", "has a first line x1_m,y1_m,x2_m,y2_m,gain_db"),
        (f"{HEADER}\n0,0,1,1,-50\n", "8 rows of finite numbers or more"),
        (f"{HEADER}\n" + "0,0,1,1,-inf\n" * 9, "-150 dB for no link"),
        (f"{HEADER}\n", "8 rows of finite numbers or more"),
        (f"{HEADER}\n" + "0,0,1,1,1e308\n" * 9, "from -1000 to 1000 dB, not 1e.308"),
        (f"{HEADER}\n" + "0,0,1,-1e300,-60\n" * 9, r"from -1e.09 to 1e.09 m, not 1e.300"),
        (f"{HEADER}\n" + "0,0,1,1,x\n" * 9, "could not convert string 'x'"),
    ],
)
def test_what_is_no_table_of_gains_is_refused(tmp_path, text, said):
    path = tmp_path / "gains.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"gains.csv raised ValueError: .*" + said):
        Components(channel=f"table:{path}").made(MISSION)
    with pytest.raises(ValueError, match=r"none.csv cannot be found"):
        Components(channel=f"table:{tmp_path / 'none.csv'}").made(MISSION)


def test_antennas_of_robots_add_to_the_gains_of_a_table(tmp_path):
    """10 dB less than free space everywhere, between two quadrotors and two rovers."""
    robot = f"quadrotor:2,{write_rover(tmp_path)}:2"
    mission = paper("stationary", num_robots=4, robot=robot)
    known = drawn_places(100, seed=11)
    rows = np.column_stack([known, friis_db(known) - 10.0])
    path = tmp_path / "gains.csv"
    np.savetxt(path, rows, delimiter=",", header=HEADER, comments="")
    channel = GainTable(mission, path)
    channel.start(4, [np.random.default_rng(0)])
    heights_m = np.array([20.0, 20.0, 0.1, 0.1])
    position_m = np.column_stack([drawn_places(4, seed=12)[:, :2], heights_m])
    received_mw = channel.mean_powers_mw(position_m, 0)
    for (i, j), (budget_db, apart_m) in links_db(position_m, (False, False, True, True)).items():
        free_mw = radio_of(mission).received_at_1_m_mw / apart_m**2
        expected_db = 10.0 * math.log10(free_mw) + budget_db - 10.0
        assert 10.0 * math.log10(received_mw[i, j]) == pytest.approx(expected_db, abs=0.01)
