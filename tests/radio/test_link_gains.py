"""Received powers of senders against the laws they are made of, and how often they are made."""

import numpy as np
from walls import walls

from swarm_mj.radio import link_gains
from swarm_mj.radio.link_gains import LinkGains
from swarm_mj.radio.power_law import NO_OBSTACLES, PowerLaw
from swarm_mj.radio.shadowing import Shadowing

EVERYONE = np.ones((2, 4), dtype=bool)
SENT = np.array([1.0, 1.0, 4.0, 1.0])  # after one metre


def gains(*, slope=(np.inf, 2.0), shadowing=None, obstacles=NO_OBSTACLES):
    made = LinkGains(PowerLaw(SENT, *slope, obstacles), shadowing)
    made.start([np.random.default_rng(seed) for seed in (1, 2)])
    return made


def places(seed=0):
    return np.random.default_rng(seed).uniform(-300.0, 300.0, (2, 4, 2))


def test_powers_are_each_robots_own_after_the_path_loss():
    position_m = places()
    received_mw = gains(slope=(10.0, 3.0)).received_mw(position_m, np.arange(2), EVERYONE)
    for b in range(2):
        for i in range(4):
            for j in range(4):
                apart_m = np.linalg.norm(position_m[b, i] - position_m[b, j])
                sent_mw = 4.0 if i == 2 else 1.0
                expected = 0.0 if i == j else sent_mw / 100.0 * (10.0 / apart_m) ** 3
                np.testing.assert_allclose(received_mw[b, i, j], expected, rtol=1e-9)


def test_powers_are_worked_out_once_for_each_sender_and_place(monkeypatch):
    asked = []
    monkeypatch.setattr(
        link_gains, "_compute", lambda _p, is_asked, *_: asked.append(is_asked.sum())
    )
    made, position_m, first_only = gains(), places(), np.zeros((2, 4), dtype=bool)
    first_only[:, 0] = True
    for is_sender in (first_only, first_only, EVERYONE, EVERYONE):
        made.received_mw(position_m, np.arange(2), is_sender)
    assert asked == [2, 6]
    position_m[1, 3] += 1.0  # mission 1 moves, mission 0 stays
    made.received_mw(position_m, np.arange(2), EVERYONE)
    assert asked == [2, 6, 4]


def test_obstacles_take_their_share():
    """A wall of 10 dB between x < 0 and x > 0."""
    position_m = places()
    position_m[:, :, 0] = np.where(np.arange(4) < 2, -1.0, 1.0) * (5.0 + np.abs(position_m[..., 0]))
    behind = gains(obstacles=walls(0.1, 0)).received_mw(position_m, np.arange(2), EVERYONE)
    open_air = gains().received_mw(position_m, np.arange(2), EVERYONE)
    is_across = (np.arange(4) < 2)[:, None] != (np.arange(4) < 2)
    np.testing.assert_allclose(behind, open_air * np.where(is_across, 0.1, 1.0))


def test_rows_may_be_any_missions_and_repeat_them():
    made, position_m = gains(), places()
    mission = np.array([1, 0, 1])
    rows = made.received_mw(position_m[mission], mission, np.ones((3, 4), dtype=bool)).copy()
    np.testing.assert_array_equal(rows, gains().received_mw(position_m, np.arange(2), EVERYONE))


def test_a_missions_shadowing_does_not_depend_on_those_beside_it():
    shadowing, position_m = Shadowing(std_db=6.0, correlation_m=20.0), places()
    both = gains(shadowing=shadowing).received_mw(position_m, np.arange(2), EVERYONE)
    alone = LinkGains(PowerLaw(SENT), shadowing)
    alone.start([np.random.default_rng(2)])
    one = alone.received_mw(position_m[1:], np.arange(1), EVERYONE[:1])
    np.testing.assert_array_equal(one[0], both[1])


def test_moving_back_finds_the_same_shadowing():
    made, there, here = (
        gains(shadowing=Shadowing(std_db=6.0, correlation_m=20.0)),
        *map(places, (1, 2)),
    )
    first = made.received_mw(there, np.arange(2), EVERYONE).copy()
    made.received_mw(here, np.arange(2), EVERYONE)
    np.testing.assert_array_equal(made.received_mw(there, np.arange(2), EVERYONE), first)
