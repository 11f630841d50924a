"""The size of replays, in memory and on disk, before one is recorded."""

from typing import NamedTuple

from swarm_mj.mission import Mission
from swarm_mj.system.needs import GB

# Longer or larger flights keep the age matrix of every k-th window only.
MAX_AGE_MATRIX_BYTES = 64e6
AGE_BYTES = 4  # float32
MAX_MATRIX_ROBOTS = 1000  # of larger teams, the matrix has every k-th robot


def in_matrix(num_robots: int) -> range:
    """Return the robots that the age matrix shows of a team."""
    return range(0, num_robots, -(-num_robots // MAX_MATRIX_ROBOTS))


class ReplaySize(NamedTuple):
    """A fit of the bytes that replays take, in memory or on disk."""

    base: float  # rerun itself, or the layout
    window: float
    robot: float  # in each window
    matrix: float  # of each byte of the age matrices
    # What robots with bodies take besides:
    bodies: float  # however many they are
    body: float  # of each, its shapes
    pose: float  # of each, in each window

    def of(self, mission: Mission, num_windows: int) -> float:
        """Return the size of the replay of so long a flight [bytes]."""
        num_robots = mission.num_robots
        matrix = AGE_BYTES * len(in_matrix(num_robots)) ** 2
        matrices = min(MAX_AGE_MATRIX_BYTES, num_windows * matrix)
        a_window = self.window + self.robot * num_robots
        size = self.base + a_window * num_windows + self.matrix * matrices
        if mission.has_bodies:
            size += self.bodies + (self.body + self.pose * num_windows) * num_robots
        return size


# Of measured peaks, when a replay is written, and of files of teams that move; others' are smaller.
# The age matrices are copied in memory and compressed in the file. Bodies are quadrotors of seven
# shapes, in teams of 40 to 200; their poses are hidden in memory by all else.
IN_MEMORY = ReplaySize(
    base=0.16 * GB, window=15e3, robot=750.0, matrix=3.3, bodies=22e6, body=0.42e6, pose=0.0
)
ON_DISK = ReplaySize(
    base=0.5e6, window=800.0, robot=110.0, matrix=0.04, bodies=0.0, body=38e3, pose=85.0
)
