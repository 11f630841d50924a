"""Refusals of what does not fit; faults/test_fit.py compares estimates with measured peaks."""

import pytest

from swarm_mj.system import needs
from swarm_mj.system.needs import Needs, check_fits


@pytest.fixture
def machine(monkeypatch):
    """8 GB of memory, 2 GB of disk, and addresses without a limit."""

    def set_to(memory=8e9, addresses=None, room=2e9, most=None):
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


def test_what_fits_passes(machine, tmp_path):
    check_fits(Needs(memory=8e9, file=2e9), tmp_path, "", is_forced=False)
    check_fits(Needs(memory=1e9, file=1e12), None, "", is_forced=False)
    machine(addresses=5e9)
    check_fits(Needs(memory=3e9, addresses=2e9), None, "", is_forced=False)


def test_a_refusal_names_need_limit_and_way_out(machine, tmp_path):
    line = refusal(Needs(memory=53.2e9))
    assert line.startswith("this takes about 53.2 GB of memory, and 8 GB are free; fly less")
    line = refusal(Needs(memory=1e9, file=12e9), tmp_path)
    assert f"about 12 GB on disk, and 2 GB fit at {tmp_path}; fly less" in line
    machine(most=1e9)
    check_fits(Needs(memory=1e9, file=1.5e9, largest_file=1e9), tmp_path, "", is_forced=False)
    line = refusal(Needs(memory=1e9, file=1.5e9), tmp_path)
    assert "about 1.5 GB in one file, and 1 GB are allowed by ulimit -f" in line
    machine(addresses=1.5e9)
    line = refusal(Needs(memory=1e9, addresses=3e9))
    assert "about 4 GB of address space, and 1.5 GB are left by ulimit -v" in line
