"""The replay's timelines."""

import numpy as np
from rerun.chunk import RrdReader


def test_the_clock_of_the_mission_runs_beside_the_windows(replay, two_way):
    (chunk,) = (
        chunk.to_record_batch()
        for chunk in RrdReader(replay).stream().filter(content="/arena/robots")
        if not chunk.is_static
    )
    nanoseconds = chunk.column("mission_time").to_numpy(zero_copy_only=False).astype(np.int64)
    np.testing.assert_allclose(nanoseconds / 1e9, 0.1 * two_way.log.window)
