"""The files of each format, and the packages that one needs."""

from pathlib import Path

import pytest

from swarm_mj.replay.export.formats import FORMATS, check_packages, files_of
from swarm_mj.system import packages

NAMES = {
    "mcap": ["a.b.mcap"],
    "ns2": ["a.b.tcl", "a.b-schedule.csv"],
    "csv": ["a.b-positions.csv", "a.b-packets.csv", "a.b-ages.csv"],
}


@pytest.mark.parametrize("to", FORMATS)
def test_files_begin_with_the_name_that_is_given(to):
    assert list(files_of(to, Path("runs/a.b"))) == [Path("runs") / name for name in NAMES[to]]


@pytest.mark.parametrize("to", FORMATS)
def test_each_file_has_content(to, requests, nothing):
    begins = {
        "a.mcap": b"\x89MCAP",
        "a.tcl": b"# flocking",
        "a-packets.csv": b"window,slot,seconds,sender,recipient,fate,num_receivers,receivers\n1,0",
        "a-schedule.csv": b"window,slot,seconds,sender,recipient,fate,num_receivers,receivers\n1,0",
        "a-positions.csv": b"window,seconds,robot,",
        "a-ages.csv": b"window,seconds,aoi,",
    }
    for file, make in files_of(to, Path("a")).items():
        assert make(requests, nothing).startswith(begins[file.name])


def test_only_mcap_needs_more_packages(monkeypatch):
    monkeypatch.setattr(packages, "is_installed", lambda module: "mcap" not in module)
    check_packages("ns2")
    check_packages("csv")
    with pytest.raises(ModuleNotFoundError, match=r"MCAP file needs mcap, .*'swarm_mj\[mcap\]'"):
        check_packages("mcap")
