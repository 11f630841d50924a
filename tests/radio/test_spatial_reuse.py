"""Who joins whom by interference, with the true radio as judge."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from spatial_rule import agreed_senders, radio
from walls import walls

from swarm_mj.mission import paper
from swarm_mj.radio.mission_radio import mission_radio
from swarm_mj.radio.power_law import no_powers
from swarm_mj.radio.spatial_reuse import (
    ask_in_turn,
    empty_slot,
    keep_joined,
    write_joined,
)

seeds = st.integers(0, 2**32 - 1)
thresholds = st.sampled_from([0.3, 1.25, 4.0])


@given(seed=seeds, num_robots=st.integers(2, 15), threshold=thresholds)
def test_eq3_those_who_may_send_and_join_do(seed, num_robots, threshold):
    """Everyone believes the truth; who may not send does not, but for the owner of the turn."""
    rng = np.random.default_rng(seed)
    position_m = rng.uniform(-500, 500, (num_robots, 2))
    order, turn = rng.permutation(num_robots), int(rng.integers(0, 99))
    may_send = rng.random(num_robots) < 0.7
    is_sending = may_send[None].copy()
    believed_m = np.tile(position_m, (1, num_robots, 1, 1))
    keep_joined(believed_m, order[None], np.array([turn]), 250.0, threshold, is_sending)
    agreed = agreed_senders(order, turn, position_m, radio(250.0, threshold))
    expected = {i for i in agreed if may_send[i]} | {order[turn % num_robots]}
    assert set(np.flatnonzero(is_sending[0]).tolist()) == expected


def joined(believed_m, is_known, turn, threshold):
    """Who sends by each robot's beliefs, one after the other in the same room."""
    num_robots = len(is_known)
    slot = empty_slot(num_robots)
    has_joined = np.full((num_robots, num_robots), 7.0, dtype=np.float32)
    for i in range(num_robots):
        write_joined(
            believed_m=believed_m[i],
            is_known=is_known[i],
            turn=turn,
            asked=ask_in_turn(np.arange(num_robots), turn),
            range_m=250.0,
            threshold=threshold,
            slot=slot,
            has_joined=has_joined[i],
        )
    assert np.all((has_joined == 0.0) | (has_joined == 1.0))
    return [np.flatnonzero(row).tolist() for row in has_joined]


@given(seed=seeds, num_robots=st.integers(2, 12), threshold=thresholds)
def test_eq3_each_robot_goes_by_its_own_beliefs(seed, num_robots, threshold):
    """Robot i believes in places of its own, and the order is that of identities."""
    rng = np.random.default_rng(seed)
    believed_m = rng.uniform(-500, 500, (num_robots, num_robots, 2))
    turn = int(rng.integers(0, 99))
    is_known = np.ones((num_robots, num_robots), dtype=bool)
    order = np.arange(num_robots)
    for i, its in enumerate(joined(believed_m, is_known, turn, threshold)):
        assert set(its) == agreed_senders(order, turn, believed_m[i], radio(250.0, threshold))


@pytest.mark.parametrize(("unknown", "expected"), [(0, []), (3, [0, 2]), (2, [0])])
def test_nobody_joins_after_a_robot_of_unknown_place(unknown, expected):
    """Two pairs far apart: robot 2 is asked first, then 3, 0 and 1; the turn is robot 0's."""
    position_m = np.array([[0.0, 0.0], [100.0, 0.0], [1000.0, 0.0], [1100.0, 0.0]])
    is_known = np.ones((4, 4), dtype=bool)
    is_known[:, unknown] = False
    assert joined(np.tile(position_m, (4, 1, 1)), is_known, 0, 1.0) == [expected] * 4


WALLS = walls(10**-1.5, 0, 1)  # 15 dB each


@given(seed=seeds, num_robots=st.integers(2, 12), stands_still=st.booleans())
def test_eq3_by_granted_powers_the_channel_itself_is_the_judge(seed, num_robots, stands_still):
    """Steeper path loss, strong radios and walls, all of them known; slot after slot."""
    rng = np.random.default_rng(seed)
    mission = paper(
        "stationary", num_robots=num_robots, prior_knowledge="map,statistics",
        path_loss="log-distance", loss_exponent=2.5, high_power_fraction=0.4,
    )  # fmt: skip
    channel, belief, _ = mission_radio(mission, WALLS)
    channel.start(num_robots, [rng])
    law = belief.law_over_noise(num_robots)
    known, order = no_powers(law, 1), rng.permutation(num_robots)
    position_m = rng.uniform(-400, 400, (num_robots, 2))
    for turn in range(4):
        if not stands_still:
            position_m = rng.uniform(-400, 400, (num_robots, 2))
        is_sending = np.ones((1, num_robots), dtype=bool)
        believed_m = np.tile(position_m, (1, num_robots, 1, 1))
        args = (believed_m, order[None], np.array([turn]), 250.0, belief.radio.threshold)
        keep_joined(*args, is_sending, known)
        judge = channel.at(np.array([turn]), np.array([0]))
        expected = agreed_senders(order, turn, position_m, judge)
        assert set(np.flatnonzero(is_sending[0]).tolist()) == expected


def test_by_granted_powers_too_each_robot_goes_by_its_own_beliefs():
    """Robot 2 takes itself to be far from the owner of the turn, and joins; the others know it."""
    mission = paper("stationary", num_robots=4, prior_knowledge="statistics", path_loss="two-ray")
    belief = mission_radio(mission).belief
    position_m = np.array([[0.0, 0.0], [30.0, 0.0], [60.0, 0.0], [61.0, 0.0]])
    believed_m = np.tile(position_m, (1, 4, 1, 1))
    believed_m[0, 2, 2:] += 5000.0
    is_sending = np.ones((1, 4), dtype=bool)
    args = (believed_m, np.arange(4)[None], np.array([0]), 250.0, belief.radio.threshold)
    keep_joined(*args, is_sending, no_powers(belief.law_over_noise(4), 1))
    assert is_sending[0].tolist() == [True, False, True, False]
