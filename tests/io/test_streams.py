"""Streams that outlast their readers: pipes, terminals and files."""

import os
import pty
import subprocess
import sys

import pytest

from swarm_mj.io.streams import lasting_streams

TALKS = """
import os, sys
from swarm_mj.io.streams import lasting_streams
with lasting_streams():
    input()  # until the reader has gone
    for _ in range(10_000):
        print("nobody hears this")
        print("nor this", file=sys.stderr)
    os.write(1, b"nor what libraries say")
open(sys.argv[1], "w").close()
"""


@pytest.mark.parametrize("make", [os.pipe, pty.openpty])
def test_work_goes_on_when_its_reader_has_gone(tmp_path, make):
    reader, writer = make()
    with subprocess.Popen(
        [sys.executable, "-c", TALKS, tmp_path / "done"],
        stdin=subprocess.PIPE, stdout=writer, stderr=writer,
    ) as talking:  # fmt: skip
        os.close(writer)
        os.close(reader)
        talking.communicate(b"\n")
    assert talking.returncode == 0
    assert (tmp_path / "done").exists()


def test_other_failures_are_told(tmp_path):
    if not os.path.exists("/dev/full"):
        pytest.skip("there is no /dev/full")
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-c", TALKS, tmp_path / "done"], input=b"\n", stdout=full, check=False
        )
    assert done.returncode != 0
    assert not (tmp_path / "done").exists()


def test_what_is_said_arrives_in_order_and_as_it_was(capfd):
    before = sys.stdout
    with lasting_streams():
        sys.stdout.write("ä")
        assert sys.stdout.encoding == before.encoding
    assert sys.stdout is before
    os.write(1, b"b")
    assert capfd.readouterr().out == "äb"


def test_streams_that_lead_to_no_file_are_left_alone(capsys):
    with lasting_streams():
        sys.stdout.write("heard\n")
    assert capsys.readouterr().out == "heard\n"
