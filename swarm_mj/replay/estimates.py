"""Estimates of the memory and disk that replays and their videos take, from measured peaks."""

from swarm_mj.mission import Mission
from swarm_mj.replay.recorder import AGE_BYTES, MAX_AGE_MATRIX_BYTES
from swarm_mj.system.needs import ADDRESSES, GB, LIBRARIES, OF_RERUN, Needs


def replay_memory(mission: Mission, num_windows: int) -> float:
    """Return the memory that recording takes at its peak, when the replay is written."""
    matrices = min(MAX_AGE_MATRIX_BYTES, AGE_BYTES * num_windows * mission.num_robots**2)
    return 0.1 * GB + (15e3 + 1e3 * mission.num_robots) * num_windows + 2.2 * matrices


def replay_file(mission: Mission) -> float:
    """Return a replay's size, of teams that move; others' are smaller."""
    matrices = min(MAX_AGE_MATRIX_BYTES, AGE_BYTES * mission.num_windows * mission.num_robots**2)
    return 0.5e6 + (500.0 + 150.0 * mission.num_robots) * mission.num_windows + 0.25 * matrices


def video_needs(width: int, height: int, num_pictures: int | float, suffix: str) -> Needs:
    """Return what `replay --video` takes; a GIF's pictures are kept until the last is drawn."""
    pixels = width * height
    kept = num_pictures if suffix == ".gif" else 0.0
    return Needs(
        memory=3.0 * LIBRARIES + (130.0 + 1.5 * kept) * pixels,
        addresses=ADDRESSES + OF_RERUN,
        file=0.1e6 + 0.05 * num_pictures * pixels,
    )
