"""Moments to draw."""

import numpy as np

from swarm_mj.mission import paper
from swarm_mj.replay.footage import Facts, Footage, Ground
from swarm_mj.replay.links import NO_MISMATCH, PacketPaths

GREEN = (39, 173, 129)  # of viridis, at 5 of its 8 steps: what is fresh by 0.625
AGE = (1.0 - 0.625) / 0.9 * 10.0  # of which robots are as green [windows]


def moment(position_m, links=(), *, observer=0, reach_m=500.0, num_windows=1, **facts):
    """Green robots at rest, the observer white, and green packets between robots."""
    where = np.tile(np.array(position_m, dtype=float), (num_windows, 1, 1))
    start, end = (np.array([pair[k] for pair in links], dtype=int) for k in (0, 1))
    own = {"policy": "mst", "seed": 3, "is_broadcast": False, "full_scale": 10.0, **facts}
    mission = paper("stationary", num_robots=where.shape[1])
    delivered = PacketPaths(np.zeros(len(start), int), where[0, start], where[0, end])
    return Footage(
        facts=Facts(mission=mission, observer=observer, **own),
        window=np.arange(1, num_windows + 1),
        position_m=where,
        velocity_mps=np.zeros_like(where),
        known_age=np.full(where.shape[:2], AGE),
        is_on=np.ones(where.shape[:2], dtype=bool),
        packets={"delivered": delivered},
        age_mean=np.ones(num_windows),
        is_cut_off=np.zeros(where.shape[:2], dtype=bool),
        mismatch=NO_MISMATCH,
        ground=Ground(centre_m=np.zeros((num_windows, 2)), reach_m=reach_m),
    )
