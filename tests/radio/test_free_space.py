"""The radio against hand numbers, inverse squares and loops over senders, receivers, interferers.

The paper's radio: 2.4 GHz, noise -50 dBm, threshold 1 dB, and 39.013 dBm for a range of 250 m.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm_mj.radio.free_space import (
    FreeSpaceRadio,
    channel_gain,
    path_loss_db,
    transmit_power_dbm,
)
from swarm_mj.radio.reception import MIN_DISTANCE_M

RANGE_M = 250.0
POWER_DBM = 39.013025
seeds = st.integers(0, 2**32 - 1)


def radio(*, range_m=RANGE_M, threshold_db=1.0, eavesdroppers=False):
    power_dbm = transmit_power_dbm(range_m, 2.4e9, -50.0, threshold_db)
    return FreeSpaceRadio(
        power_mw=10 ** (power_dbm / 10),
        noise_mw=1e-5,
        threshold=10 ** (threshold_db / 10),
        frequency_hz=2.4e9,
        recipient_hears_while_sending=eavesdroppers,
    )


def scene(seed, num_robots, *, num_missions=1):
    """Robots at random places, of whom about half address a neighbour or anybody."""
    rng = np.random.default_rng(seed)
    position_m = rng.uniform(-400.0, 400.0, (num_missions, num_robots, 2))
    apart_m = np.linalg.norm(position_m[:, :, None] - position_m[:, None], axis=-1)
    nearest = np.argsort(apart_m)[..., 1]  # after oneself
    anybody = rng.integers(0, num_robots, nearest.shape)
    chance = rng.random(nearest.shape)
    choices = [np.arange(num_robots), nearest]
    return position_m, np.select([chance < 0.5, chance < 0.8], choices, anybody)


def alone(channel, position_m, recipient):
    """Whom each robot of a single mission decodes."""
    heard = channel(np.array([position_m], dtype=float), np.array([recipient]))
    return heard[0].tolist()


def received_mw(power_dbm, a, b):
    """Eqs. 1 and 2 as the paper prints them."""
    loss_db = 20 * math.log10(math.dist(a, b)) + 20 * math.log10(2.4e9) - 147.55
    return 10 ** (power_dbm / 10) * 10 ** (-loss_db / 10)


def packets_above_threshold(position_m, recipient, eavesdroppers, power_dbm, threshold_db):
    """Every (i, j) whose packet clears the threshold, by loops over i, j and the interferers k."""
    robots = range(len(recipient))
    senders = [i for i in robots if recipient[i] != i]
    clear = set()
    for i in senders:
        for j in robots:
            if j == i:
                continue
            # Eq. 3 sums over a sending receiver too, from distance 0: it drowns everything. The
            # authors' code lets it hear what is addressed to it.
            if j in senders and not (eavesdroppers and recipient[i] == j):
                continue
            interference = 0.0
            for k in senders:
                if k not in (i, j):
                    interference += received_mw(power_dbm, position_m[k], position_m[j])
            signal = received_mw(power_dbm, position_m[i], position_m[j])
            ratio_db = 10 * math.log10(signal / (1e-5 + interference))
            if ratio_db >= threshold_db:
                clear.add((i, j))
    return clear


def test_eq1_path_loss_by_hand():
    # 20 log10(250) = 47.958800, 20 log10(2.4e9) = 187.604225.
    assert path_loss_db(250.0, 2.4e9) == pytest.approx(47.958800 + 187.604225 - 147.55)
    assert path_loss_db(250.0, 2.4e9) == pytest.approx(88.013025)
    assert path_loss_db(1.0, 1.0) == -147.55


@given(distance_m=st.floats(1e-3, 1e5), frequency_hz=st.floats(1e6, 1e12))
def test_eq1_path_loss_is_friis_free_space(distance_m, frequency_hz):
    friis_db = 20 * math.log10(4 * math.pi * distance_m * frequency_hz / 299_792_458.0)
    # The paper rounds -147.5522 dB to -147.55 dB.
    assert path_loss_db(distance_m, frequency_hz) == pytest.approx(friis_db, abs=0.0025)


@pytest.mark.parametrize(
    ("loss_db", "gain"), [(0.0, 1.0), (10.0, 0.1), (30.0, 1e-3), (3.010299957, 0.5), (-20.0, 100.0)]
)
def test_eq2_gain_by_hand(loss_db, gain):
    assert channel_gain(loss_db) == pytest.approx(gain)


def test_powers_by_hand():
    assert transmit_power_dbm(250.0, 2.4e9, -50.0, 1.0) == pytest.approx(POWER_DBM)
    assert transmit_power_dbm(500.0, 2.4e9, -50.0, 1.0) == pytest.approx(POWER_DBM + 6.020600)
    assert transmit_power_dbm(250.0, 2.4e9, -47.0, 4.0) == pytest.approx(POWER_DBM + 6.0)


def test_power_at_a_metre_is_eqs_1_and_2():
    # 39.013025 dBm - (187.604225 - 147.55) dB = -1.0412 dBm.
    assert radio().received_at_1_m_mw == pytest.approx(10**-0.10412)


@given(seed=seeds, num_robots=st.integers(2, 8), eavesdroppers=st.booleans())
@settings(max_examples=200)
def test_eq4_decoded_as_by_loops(seed, num_robots, eavesdroppers):
    position_m, recipient = scene(seed, num_robots)
    clear = packets_above_threshold(position_m[0], recipient[0], eavesdroppers, POWER_DBM, 1.0)
    for j in range(num_robots):
        # Above 0 dB two packets cannot both be stronger than each other.
        assert len([i for i, receiver in clear if receiver == j]) <= 1
    heard = radio(eavesdroppers=eavesdroppers)(position_m, recipient)[0]
    assert {(i, j) for j, i in enumerate(heard) if i != j} == clear


@given(seed=seeds, num_robots=st.integers(2, 8), eavesdroppers=st.booleans())
@settings(max_examples=100)
def test_below_0_db_the_nearest_packet_that_clears_the_threshold_wins(
    seed, num_robots, eavesdroppers
):
    position_m, recipient = scene(seed, num_robots)
    power_dbm = POWER_DBM - 11.0  # as far at a threshold of -10 dB
    clear = packets_above_threshold(position_m[0], recipient[0], eavesdroppers, power_dbm, -10.0)
    nearest = {}
    for i, j in clear:
        rival = nearest.get(j, i)
        nearest[j] = min(i, rival, key=lambda k: math.dist(position_m[0, k], position_m[0, j]))
    heard = radio(threshold_db=-10.0, eavesdroppers=eavesdroppers)(position_m, recipient)[0]
    assert {j: i for j, i in enumerate(heard) if i != j} == nearest


def test_coincident_robots_stay_finite():
    here, away = [5.0, 5.0], [200.0, 5.0]
    assert alone(radio(), [here, here], [1, 1]) == [0, 0]
    # Closer than the least distance counts as that far, so equal powers: 0 dB, nobody decodes.
    near = [5.0 + MIN_DISTANCE_M / 2, 5.0]
    assert alone(radio(), [here, here, here, away], [1, 1, 1, 3])[1] == 1
    assert alone(radio(), [here, here, near, away], [1, 1, 1, 3])[1] == 1
    assert alone(radio(), [here, here, away], [1, 1, 1])[1] == 0
    assert alone(radio(eavesdroppers=True), [here, here], [1, 0]) == [1, 0]
