"""Every wheel is pinned, and all but torch's have the hashes that they were tested with."""

import re
from pathlib import Path

TOOLS = Path(__file__).parents[2] / "tools"
BY_PLATFORM = {"appnope", "pywin32-ctypes", "setuptools"}  # of macOS, of Windows, of some Pythons


def name_of(pin):
    """A pin's package, as the index spells it."""
    return re.sub(r"[-_.]+", "-", pin.partition("==")[0]).lower()


def test_hashes_are_of_the_pinned_versions():
    lines = (TOOLS / "constraints.txt").read_text().splitlines()
    pinned = {name_of(line): line.partition("==")[2] for line in lines if "==" in line}
    hashed = {}
    entries = "\n".join(path.read_text().strip() for path in sorted(TOOLS.glob("hashes*.txt")))
    for entry in re.split(r"\n(?=\S)", entries):
        pin, *hashes = re.split(r"\s+(?:;[^\\]*)?\\\s+", entry.strip())
        hashed[name_of(pin)] = pin.partition("==")[2].partition(" ")[0]
        assert hashes
        assert all(re.fullmatch(r"--hash=sha256:[0-9a-f]{64}", each) for each in hashes), pin
    extra = {name: hashed.pop(name) for name in BY_PLATFORM}
    assert all(extra.values())
    del pinned["torch"]
    assert hashed == pinned
