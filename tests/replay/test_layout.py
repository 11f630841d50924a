"""The replay's layout."""

from rerun.chunk import RrdReader


def test_the_layout_is_inside_the_file(replay):
    assert len(RrdReader(replay).blueprints()) == 1
