"""Refusals of what does not fit; faults/test_fit.py compares estimates with measured peaks."""

import math
import resource
import shutil
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest

from swarm_mj.system import needs
from swarm_mj.system.needs import Needs, check_fits


@pytest.fixture
def machine(monkeypatch):
    """8 GB of memory, 2 GB of disk, and addresses without a limit."""

    def set_to(memory=8e9, addresses=math.inf, room=2e9, most=math.inf):
        monkeypatch.setattr(needs, "free_memory", lambda: memory)
        monkeypatch.setattr(needs, "free_addresses", lambda: addresses)
        monkeypatch.setattr(needs, "free_room", lambda _: room)
        monkeypatch.setattr(needs, "largest_file", lambda: most)

    set_to()
    return set_to


def refusal(its_needs, output=None):
    with pytest.raises(ValueError, match=r"or try it with --yes$") as refused:
        check_fits(its_needs, output, "fly less", is_forced=False)
    check_fits(its_needs, output, "fly less", is_forced=True)
    return str(refused.value)


@pytest.mark.slow
def test_a_peak_outlasts_what_was_held():
    Path("/proc/self/clear_refs").write_text("5")  # or the peak is that of an earlier test
    before = needs.peak_memory()
    assert before >= 0.9 * psutil.Process().memory_info().rss
    bytearray(b"1") * int(before)
    assert needs.peak_memory() > 1.5 * before


def test_what_fits_passes(machine, tmp_path):
    check_fits(Needs(memory=8e9, file=2e9), tmp_path, "", is_forced=False)
    check_fits(Needs(memory=1e9, file=1e12), None, "", is_forced=False)
    machine(addresses=7.2e9)
    check_fits(Needs(memory=3e9), None, "", is_forced=False)


def test_a_refusal_names_need_limit_and_way_out(machine, tmp_path):
    line = refusal(Needs(memory=53.2e9))
    assert line.startswith("this takes about 53.2 GB of memory, and 8 GB are free; fly less")
    line = refusal(Needs(memory=53.2e9, grows="gnn remembers much"))
    assert "8 GB are free; gnn remembers much; fly less" in line
    line = refusal(Needs(memory=1e9, file=12e9, grows="gnn remembers much"), tmp_path)
    assert "gnn" not in line
    assert f"about 12 GB on disk, and 2 GB fit at {tmp_path}; fly less" in line
    machine(most=1e9)
    check_fits(Needs(memory=1e9, file=1e9), tmp_path, "", is_forced=False)
    line = refusal(Needs(memory=1e9, file=1.5e9), tmp_path)
    assert "about 1.5 GB in files, and 1 GB are allowed in one by ulimit -f" in line
    machine(addresses=1.5e9)
    line = refusal(Needs(memory=1e9))
    assert "about 5.2 GB of address space, and 1.5 GB are left by ulimit -v" in line


def test_free_memory_is_the_machines(monkeypatch, tmp_path):
    monkeypatch.setattr(needs, "CONTROL_GROUPS", tmp_path)  # where there are none
    assert 0 < needs.free_memory() <= psutil.virtual_memory().total


@pytest.mark.parametrize(
    ("line", "folder", "limit", "usage", "stat"),
    [
        ("0::/a/b", "a", "max", "current", "inactive_file 7\nanon 9"),
        ("4:memory:/a/b", "memory/a", "limit_in_bytes", "usage_in_bytes", "total_active_file 7"),
    ],
)
def test_control_groups_leave_their_limits_less_what_they_cannot_give_back(
    tmp_path, monkeypatch, line, folder, limit, usage, stat
):
    """Of this process's and its parents; a group without a limit leaves all."""
    monkeypatch.setattr(needs, "CONTROL_GROUPS", tmp_path)
    monkeypatch.setattr(Path, "exists", lambda _: True)
    read = Path.read_text
    groups = Path("/proc/self/cgroup")
    monkeypatch.setattr(
        Path, "read_text", lambda path: f"9:pids:/x\n{line}\n" if path == groups else read(path)
    )
    group = tmp_path / folder
    group.mkdir(parents=True)
    (group / f"memory.{usage}").write_text("3000\n")
    (group / "memory.stat").write_text(stat)
    (group / f"memory.{limit}").write_text("max\n")
    assert list(needs._left_by_groups()) == []
    (group / f"memory.{limit}").write_text("5000\n")
    assert needs.free_memory() == 5000 - 3000 + 7


def test_addresses_and_files_are_what_ulimit_leaves(monkeypatch):
    limits = {}  # of this process, by their numbers; none unless set
    none = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
    monkeypatch.setattr(needs.resource, "getrlimit", lambda which: limits.get(which, none))
    assert (needs.free_addresses(), needs.largest_file()) == (math.inf, math.inf)
    limits |= {resource.RLIMIT_AS: (10**15, 10**15), resource.RLIMIT_FSIZE: (4096, 4096)}
    used = psutil.Process().memory_info().vms
    assert needs.free_addresses() == pytest.approx(10**15 - used, abs=1e8)
    assert needs.largest_file() == 4096


def test_files_may_take_what_the_disk_has_where_a_link_leads(tmp_path, monkeypatch):
    file = tmp_path / "not" / "yet" / "made.rrd"
    assert needs.free_room(file) == pytest.approx(shutil.disk_usage(tmp_path).free, rel=0.1)
    (tmp_path / "far").mkdir()
    (tmp_path / "link.rrd").symlink_to(tmp_path / "far" / "there.rrd")
    free = {tmp_path: 1, tmp_path / "far": 2}
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=free[folder]))
    assert needs.free_room(tmp_path / "link.rrd") == 2


@pytest.mark.parametrize(
    ("error", "becomes"),
    [
        (RuntimeError("can't allocate memory: you tried"), MemoryError),
        (RuntimeError("CUDA out of memory"), MemoryError),
        (ValueError("Error: engine error: Could not allocate memory"), MemoryError),  # MuJoCo's
        (RuntimeError("other"), RuntimeError),
    ],
)
def test_a_librarys_lack_of_memory_is_a_memory_error(error, becomes):
    with pytest.raises(becomes), needs.memory_errors():
        raise error
