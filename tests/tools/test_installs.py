"""Every install line of the documentation is tried by `make test-installs`."""

from pathlib import Path

import installs
from installs import INSTALLS, Install, commands, shown_lines


def test_all_shown_lines_are_tried_and_no_others():
    tried = {line for install in INSTALLS for line in install.lines}
    assert shown_lines() == tried


def test_a_line_installs_this_wheel_in_place_of_the_package():
    wheel = Path("/dist/swarm_mj-1.1.0-py3-none-any.whl")
    install = Install(lines=("pip install '.[ray]' vmas",), program="", is_on_top=True)
    first, second = commands(install, Path("/env/bin/python"), wheel)
    assert first[-1] == str(wheel)
    assert second[-2:] == [f"{wheel}[ray]", "vmas"]
    assert second[0] == str(installs.UV)
