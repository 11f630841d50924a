"""Counts what the fault suite tried and what held, by the marker `fault("class")` of each test.

A test is one try unless it says `record_property("tries", n)`, of which `record_property("held",
n)` held, or all of them if it passed.
"""

from collections import Counter

import pytest

CLASS = "fault class"


def pytest_configure(config):
    """Declares the marker."""
    config.addinivalue_line("markers", "fault(name): the class of faults that a test tries")


@pytest.fixture(autouse=True)
def _class_of_fault(request, record_property):
    marker = request.node.get_closest_marker("fault")
    assert marker is not None, "say which class of faults this is: @pytest.mark.fault(name)"
    record_property(CLASS, marker.args[0])


def pytest_terminal_summary(terminalreporter):
    """Prints a line for each class: tried and held."""
    tried, held = Counter(), Counter()
    for outcome in ("passed", "failed"):
        for report in terminalreporter.stats.get(outcome, []):
            said = dict(report.user_properties)
            if report.when == "call" and CLASS in said:
                num_tries = said.get("tries", 1)
                tried[said[CLASS]] += num_tries
                held[said[CLASS]] += said.get("held", num_tries if report.passed else 0)
    if tried:
        terminalreporter.section("faults: tried and held")
        for name in sorted(tried):
            terminalreporter.line(f"{name:<44} {tried[name]:>6} tried  {held[name]:>6} held")
