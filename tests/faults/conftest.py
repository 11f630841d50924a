"""Counts what the fault suite tried and what held, by the marker `fault("class")` of each test.

A test is one try unless it records how many "tries" it makes.
"""

import csv
import os
from collections import Counter
from pathlib import Path

import pytest

from swarm_mj.system.packages import commit

CLASS = "fault class"
FACTOR = float(os.environ.get("SWARM_MJ_TRIES", "1"))
TABLE = os.environ.get("SWARM_MJ_FAULTS")  # where the counts go


def pytest_configure(config):
    """Declares the marker."""
    config.addinivalue_line("markers", "fault(name): the class of faults that a test tries")


@pytest.fixture(autouse=True)
def _class_of_fault(request, record_property):
    marker = request.node.get_closest_marker("fault")
    assert marker is not None, "say which class of faults this is: @pytest.mark.fault(name)"
    record_property(CLASS, marker.args[0])


@pytest.fixture
def tries(record_property):
    """How often to try: a little in every test run, under `make attack` many times as often."""

    def number(usual):
        number = max(1, round(usual * FACTOR))
        record_property("tries", number)
        return number

    return number


def pytest_terminal_summary(terminalreporter):
    """Prints a line for each class: tried and held. Workers have counted only their own tests."""
    if hasattr(terminalreporter.config, "workerinput"):
        return
    tried, held = Counter(), Counter()
    for outcome in ("passed", "failed"):
        for report in terminalreporter.stats.get(outcome, []):
            name = dict(report.user_properties).get(CLASS)
            if report.when == "call" and name:
                num_tries = sum(n for key, n in report.user_properties if key == "tries") or 1
                tried[name] += num_tries
                held[name] += num_tries if report.passed else 0
    if tried:
        terminalreporter.section("faults: tried and held")
        for name in sorted(tried):
            terminalreporter.line(f"{name:<44} {tried[name]:>6} tried  {held[name]:>6} held")
    if tried and TABLE:
        with Path(TABLE).open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["fault", "tried", "held", "commit"])
            writer.writerows((each, tried[each], held[each], commit()) for each in sorted(tried))
            writer.writerow(["all", tried.total(), held.total(), commit()])
