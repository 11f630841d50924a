"""All numbers of self-organised TDMA that were chosen by trial.

Each is the best of a few that were tried on 8 to 12 missions of 300 windows with seeds from 1000,
mostly of 40 robots, at rest and walking (`training/RESULTS.md`).
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class SotdmaSettings:
    """Of frames, and of how robots choose their slots; a round is N slots."""

    slots_per_root: float = 3.2  # a frame's slots, over the square root of N
    first_rounds: int = 3  # of spatial TDMA, before the first frame [rounds]
    frames_per_choice: int = 4  # in which everyone chooses anew once [frames]
    simulated_frames: int = 4  # that a choice looks ahead; the last one counts [frames]
    start_frames: float = 6.0  # how old news is when that begins [frames]
    least_gain_windows: float = 0.1  # of mean age, that a new slot must be better by [windows]
    interference: float = 1.2  # times what robots believe of it: choices at the edge fail
    predicted_slots: int = 48  # for so long a choice is predicted that was not heard of [slots]
    marked_slots: int = 200  # for so long a slot that a neighbour missed is marked [slots]
    least_doubt: float = 0.1  # a slot is marked if chance explains the misses with less than this
    contention_every: int = 16  # one of so many slots is no part of the frames [slots]
    contention_probability: float = 0.4  # that a robot in need transmits in it [1]
    need_frames: float = 3.0  # a neighbour not heard for longer is in need, or oneself [frames]
    lost_frames: float = 12.0  # and one not heard for even longer is gone [frames]

    def frame_slots(self, num_robots: int) -> int:
        """How many slots the frames of so many robots have."""
        return max(2, min(num_robots, round(self.slots_per_root * math.sqrt(num_robots))))
