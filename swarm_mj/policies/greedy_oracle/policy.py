"""Greedy oracles: what a scheduler could do that knew everything at every moment.

They are no policies a team could fly, but show where the age of information could go.
"""

from abc import abstractmethod

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.greedy_oracle.schedule import (
    greedy_schedule,
    lookahead_window,
)
from swarm_mj.policies.policy import CentralisedPolicy
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.link_models import TrueLinks
from swarm_mj.radio.links import Links


class _Oracle(CentralisedPolicy):
    """Plans each window of each mission from all true buffers and positions."""

    def __init__(self, radio: FreeSpaceRadio) -> None:
        """Prepare the policy.

        Args:
            radio: What is true unless the policy is informed otherwise.
        """
        self._truth = TrueLinks(radio=radio)

    def inform(self, truth: TrueLinks) -> None:
        """Reckons with the true channel from now on."""
        self._truth = truth

    def recipients(self, views: LocalViews, states: RobotStates) -> Int[np.ndarray, "B N"]:
        """Return the window's schedule; robots move before they talk, which it does not foresee."""
        windows = [
            self._window(timestamp, float(now), self._truth.links(position_m, b))
            for b, (timestamp, now, position_m) in enumerate(
                zip(views.buffers.timestamp, views.now, states.position_m, strict=True)
            )
        ]
        return np.stack(windows)

    @abstractmethod
    def _window(
        self, timestamp: Float[np.ndarray, "N N"], now: float, links: Links
    ) -> Int[np.ndarray, "N"]:
        """One mission's recipients."""


class GreedyOracle(_Oracle):
    """Adds pairs while the age that the window removes grows: myopic, and not optimal.

    Centralised: it is told all buffers and all true positions. It addresses nobody who sends, even
    where the authors' code would let that robot hear.
    """

    uses = "all buffers, all true positions and the true channel but for its fades, at every moment"

    def _window(
        self, timestamp: Float[np.ndarray, "N N"], now: float, links: Links
    ) -> Int[np.ndarray, "N"]:
        schedule, _ = greedy_schedule(timestamp, now, links, 1, is_squared=False)
        return schedule[0]


class LookaheadOracle(_Oracle):
    """Follows the best first pairs through greedy windows and takes the branch of least age.

    Centralised, as `GreedyOracle`, which sees only the window it is in: it spends packets on many
    small refreshments, where a packet that waits for news would carry more. This one weighs rises
    of T squared and sees what a window leads to.
    """

    uses = "as greedy-oracle, and it looks four windows ahead; slow"

    NUM_BRANCHES = 6  # first pairs tried
    NUM_WINDOWS = 4  # windows each is followed

    def _window(
        self, timestamp: Float[np.ndarray, "N N"], now: float, links: Links
    ) -> Int[np.ndarray, "N"]:
        return lookahead_window(
            timestamp,
            now,
            links,
            num_branches=self.NUM_BRANCHES,
            num_windows=self.NUM_WINDOWS,
        )
