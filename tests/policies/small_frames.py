"""Small frames, and their ages by plain loops."""

import numpy as np

from swarm_mj.mission import paper
from swarm_mj.policies.sotdma.frame import NOWHERE, Rule, add, empty_frame
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.radio.power_law import PowerLaw, powers_between

RADIO = radio_of(paper("stationary"))
NUM_ROBOTS, NUM_SLOTS, FRAMES = 9, 5, 3
RULE = Rule(RADIO.threshold, NUM_SLOTS, simulated_frames=FRAMES, start_frames=2.0, interference=1.2)


def team(seed):
    """Positions [m], and powers between them [noise]."""
    position_m = np.random.default_rng(seed).uniform(-400.0, 400.0, (NUM_ROBOTS, 2))
    at_1_m = np.full(NUM_ROBOTS, RADIO.received_at_1_m_mw / RADIO.noise_mw)
    return position_m, powers_between(position_m, PowerLaw(at_1_m))


def frame_of(power, slots, interference=1.0):
    """A frame in which robot k transmits in `slots[k]`, unless that is `NOWHERE`."""
    frame = empty_frame(power, RULE._replace(interference=interference))
    for k, slot in enumerate(slots):
        if slot != NOWHERE:
            add(frame, slot, k)
    return frame


def aged(heard):
    """Mean age in the last frame [slots]: every robot is told, one after the other."""
    num_robots = heard.shape[1]
    known = np.full((num_robots, num_robots), -10.0)
    ages = []
    for now in range(1, FRAMES * NUM_SLOTS + 1):
        np.fill_diagonal(known, now)
        said = known.copy()
        for j, sender in enumerate(heard[(now - 1) % NUM_SLOTS]):
            known[j] = np.maximum(known[j], said[sender])
        ages.append(np.mean(now - known))
    return np.mean(ages[-NUM_SLOTS:])
