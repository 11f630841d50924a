"""Parity with the authors' environment: recorded positions and recipients give its buffers.

A recording holds `pos_vel` [T+1, N, 4] (the start, then one row per window), `recipient` [T, N],
`buffer_every_25` [T/25, N, N, 7] (columns T, P, M = px py vx vy, L) and `reward` [T].
"""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from turns import settled

from swarm_mj.mission import reference
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import empty_buffers, observe_self
from swarm_mj.protocol.costs import age_of_information
from swarm_mj.protocol.window import window
from swarm_mj.radio.mission_radio import radio_of

RECORDINGS = Path(__file__).parent / "golden"
EVERY = 25  # windows between two recorded buffers

TEAMS = {
    "stationary_10": reference("stationary", num_robots=10),
    "random_walk_40": reference("random-walk", num_robots=40),
}
recorded_teams = pytest.mark.parametrize("name", TEAMS)


@cache
def load(name):
    with np.load(RECORDINGS / f"{name}.npz") as recording:
        return dict(recording)


@cache
def replayed(name):
    """Plays a recording in; returns the ages of all windows and the buffers at checkpoints."""
    recording, mission = load(name), TEAMS[name]
    channel = radio_of(mission)
    start, *flown = (
        RobotStates(position_m=row[None, :, :2].copy(), velocity_mps=row[None, :, 2:].copy())
        for row in recording["pos_vel"]
    )
    buffers, now = empty_buffers(1, mission.num_robots), np.zeros(1)
    observe_self(buffers, start, now)
    ages, checkpoints, attempts = [], [], {"silence_is_attempt": mission.silence_is_attempt}
    for w, recipient in enumerate(recording["recipient"].astype(np.int64)):
        window(buffers, *settled(flown[w], recipient[None]), channel, now, **attempts)
        now = now + 1
        ages.append(age_of_information(buffers, now)[0].item())
        if (w + 1) % EVERY == 0:
            m = np.concatenate([buffers.position_m[0], buffers.velocity_mps[0]], axis=-1)
            known = {"T": buffers.timestamp, "P": buffers.parent, "L": buffers.last_attempt}
            checkpoints.append({"M": m, **{name: table[0].copy() for name, table in known.items()}})
    return np.array(ages), checkpoints


@recorded_teams
def test_the_recordings_are_of_the_missions_they_are_replayed_in(name):
    recording, mission = load(name), TEAMS[name]
    assert len(recording["buffer_every_25"]) >= 4
    # Their r_max is the paper's P_max, half the side of the area.
    assert recording["r_max"] == pytest.approx(mission.half_side_m)
    assert 10 ** (recording["power_dbm"][0] / 10) == pytest.approx(radio_of(mission).power_mw)


@recorded_teams
def test_replayed_buffers_are_the_authors(name):
    """Times, parents and attempts exactly; states in the recording's single precision."""
    _, checkpoints = replayed(name)
    for ours, theirs in zip(checkpoints, load(name)["buffer_every_25"], strict=True):
        for column, symbol in ((0, "T"), (1, "P"), (6, "L")):
            np.testing.assert_array_equal(ours[symbol], theirs[..., column], err_msg=symbol)
        np.testing.assert_allclose(ours["M"], theirs[..., 2:6], rtol=0.0, atol=2e-5)


@recorded_teams
def test_eq10_the_authors_reward_is_our_age(name):
    ages, _ = replayed(name)
    np.testing.assert_allclose(-ages / 500.0, load(name)["reward"], rtol=0.0, atol=1e-9)
