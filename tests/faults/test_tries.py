"""The fault suite counts its tries."""

from pathlib import Path

import pytest

pytest_plugins = ["pytester"]


@pytest.mark.fault("the suite itself")
def test_it_counts_what_was_tried_and_what_held(pytester):
    pytester.makeconftest(Path(__file__).with_name("conftest.py").read_text())
    pytester.makepyfile(
        """
        import pytest

        @pytest.mark.fault("flips")
        def test_all_hold(record_property):
            record_property("tries", 30)

        @pytest.mark.fault("flips")
        def test_one_does_not(record_property):
            record_property("tries", 5)
            record_property("held", 4)
            assert False
        """
    )
    lines = pytester.runpytest_inprocess("-p", "no:cacheprovider").outlines
    assert any(line.split() == ["flips", "35", "tried", "34", "held"] for line in lines)
