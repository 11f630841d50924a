"""A training that is shown while it goes on: its newest policy's flight, and the learning curve."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from swarm_mj.learning import held_out, selection
from swarm_mj.learning.selection import CurveRow
from swarm_mj.learning.settings import Training
from swarm_mj.protocol.mission_costs import AOI
from swarm_mj.replay.recorder import Recorder
from swarm_mj.replay.view import LiveViewer

if TYPE_CHECKING:  # rerun is slow to import, and trainings that are not shown do without
    from swarm_mj.replay.training_curve import TrainingCurve


class LiveTraining:
    """Shows a run in a viewer that is open; each evaluation is a flight of its own there."""

    def __init__(self, viewer: LiveViewer) -> None:
        """Take the viewer, which nothing else shows flights in."""
        self._viewer = viewer
        self._has_shown = False

    def show(
        self, training: Training, recorder: Recorder, decisions: int, curve: Sequence[CurveRow]
    ) -> None:
        """Show a flight of the newest policy, which then plays on, and all evaluations so far.

        Args:
            training: The settings of the run.
            recorder: What `held_out.record_first` returned.
            decisions: Of teams, that the policy has learned from.
            curve: At least one evaluation.

        Raises:
            ConnectionError: The viewer was closed.
        """
        from swarm_mj.replay.live import LiveReplay  # rerun is slow to import

        if self._viewer.process.poll() is not None:
            raise ConnectionError("it was closed")
        replay = LiveReplay(
            recorder,
            held_out.recorded_of(training, decisions),
            f"after {decisions:,} decisions",
            self._viewer.address,
            curve=training_curve(training, curve),
            # Once: the next would undo what the user has changed, such as the tab.
            has_layout=not self._has_shown,
        )
        replay.finish()
        replay.close()
        self._has_shown = True


def training_curve(training: Training, rows: Sequence[CurveRow]) -> "TrainingCurve":
    """Return what is drawn of a learning curve: the cost to lower, and the references' costs."""
    from swarm_mj.replay.training_curve import TrainingCurve

    cost = training.cost
    costs = [getattr(row.costs, cost.column) for row in rows]
    sems = [0.0] * len(rows)
    if cost is AOI:  # evaluations tell the error of the age alone
        sems = [row.costs.aoi_sem or 0.0 for row in rows]
    references: dict[str, float] = {}
    for name in selection.COMPARED:
        reference = rows[-1].references.get(selection.column(cost, name))
        if reference is not None:
            references[name] = reference
    return TrainingCurve(
        title=cost.label,
        digits=cost.digits,
        decisions=np.array([float(row.decisions) for row in rows]),
        cost=np.array(costs),
        sem=np.array(sems),
        references=references,
    )
