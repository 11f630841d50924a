"""What this machine has left, by limits that the tests set."""

import resource
import shutil
from types import SimpleNamespace

import psutil
import pytest

from swarm_mj.system import machine

NO_LIMIT = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)


@pytest.fixture
def limits(monkeypatch):
    """Limits of this process, by their numbers; none unless set."""
    found = {}
    monkeypatch.setattr(machine.resource, "getrlimit", lambda which: found.get(which, NO_LIMIT))
    return found


def write_group(folder, **files):
    folder.mkdir(parents=True)
    for name, text in files.items():
        (folder / name.replace("__", ".")).write_text(text)


def test_free_memory_is_the_machines(monkeypatch, tmp_path):
    monkeypatch.setattr(machine, "CONTROL_GROUPS", tmp_path)  # where there are none
    free = machine.free_memory()
    assert 0 < free <= psutil.virtual_memory().total


@pytest.mark.parametrize(
    ("folder", "files"),
    [
        ("", {"memory__max": "5000", "memory__current": "3000", "memory__stat": "inactive_file 7"}),
        (
            "memory",
            {
                "memory__limit_in_bytes": "5000",
                "memory__usage_in_bytes": "3000",
                "memory__stat": "cache 1\ntotal_inactive_file 7",
            },
        ),
    ],
)
def test_a_control_group_leaves_its_limit_less_what_it_cannot_give_back(tmp_path, folder, files):
    write_group(tmp_path / "group" / folder, **files)
    names = machine.GROUP_FILES[folder]
    assert list(machine._left(tmp_path / "group" / folder, *names)) == [5000 - 3000 + 7]


def test_a_control_group_without_a_limit_leaves_all(tmp_path):
    write_group(tmp_path / "g", memory__max="max", memory__current="3", memory__stat="")
    assert not list(machine._left(tmp_path / "g", *machine.GROUP_FILES[""]))


def test_the_least_of_all_groups_counts(monkeypatch):
    monkeypatch.setattr(machine, "_allowed_by_groups", lambda: iter([10**18, 123]))
    assert machine.free_memory() == 123


def test_addresses_are_what_ulimit_leaves(limits):
    assert machine.free_addresses() is None
    limits[resource.RLIMIT_AS] = (10**15, 10**15)
    used = psutil.Process().memory_info().vms
    assert machine.free_addresses() == pytest.approx(10**15 - used, abs=1e8)


def test_files_may_take_what_the_disk_has_and_one_what_the_limit_allows(limits, tmp_path):
    file = tmp_path / "not" / "yet" / "made.rrd"
    assert machine.free_room(file) == pytest.approx(shutil.disk_usage(tmp_path).free, rel=0.1)
    assert machine.largest_file() is None
    limits[resource.RLIMIT_FSIZE] = (4096, 4096)
    assert machine.largest_file() == 4096


def test_the_disk_is_the_one_where_a_link_leads(tmp_path, monkeypatch):
    (tmp_path / "far").mkdir()
    (tmp_path / "link.rrd").symlink_to(tmp_path / "far" / "there.rrd")
    free = {tmp_path: 1, tmp_path / "far": 2}
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=free[folder]))
    assert machine.free_room(tmp_path / "link.rrd") == 2


@pytest.mark.parametrize(
    "error",
    [
        RuntimeError("can't allocate memory: you tried"),
        RuntimeError("CUDA out of memory"),
        ValueError("Error: engine error: Could not allocate memory"),  # MuJoCo's
    ],
)
def test_a_librarys_lack_of_memory_is_a_memory_error(error):
    with pytest.raises(MemoryError), machine.memory_errors():
        raise error


def test_other_errors_stay_what_they_are():
    with pytest.raises(RuntimeError, match="other"), machine.memory_errors():
        raise RuntimeError("other")
