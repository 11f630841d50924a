"""Streams that outlast their readers: pipes, terminals and files."""

import io
import os
import pty
import subprocess
import sys

import pytest

from swarm_mj.system.streams import lasting_streams

TALKS = """
import os, sys
from swarm_mj.system.streams import lasting_streams
with lasting_streams() as failure:
    input()  # until the reader has gone
    for _ in range(10_000):
        print("nobody hears this")
        print("nor this", file=sys.stderr)
    os.write(1, b"nor what libraries say")
    open(sys.argv[1], "w").close()
    sys.exit(failure() and failure().strerror)
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


def test_other_failures_are_told_when_the_work_is_done(tmp_path):
    if not os.path.exists("/dev/full"):
        pytest.skip("there is no /dev/full")
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-c", TALKS, tmp_path / "done"],
            input=b"\n", stdout=full, stderr=subprocess.PIPE, check=False,
        )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == b"No space left on device"
    assert b"Traceback" not in done.stderr
    assert (tmp_path / "done").exists()


def test_streams_are_put_back_even_if_one_cannot_be_flushed(monkeypatch):
    class Broken(io.StringIO):
        def flush(self):
            raise BlockingIOError

    broken = Broken()
    monkeypatch.setattr(sys, "stdout", broken)
    error = sys.stderr
    with pytest.raises(BlockingIOError), lasting_streams():
        assert sys.stderr is not error
    assert (sys.stdout, sys.stderr) == (broken, error)


def test_a_stream_that_only_has_a_file_s_number_is_left_alone(monkeypatch, capfd):
    """A notebook's stream has that of its server's terminal."""

    class Notebook(io.StringIO):
        def fileno(self):
            return 1

    monkeypatch.setattr(sys, "stdout", notebook := Notebook())
    with lasting_streams():
        sys.stdout.write("shown in the notebook")
    assert notebook.getvalue() == "shown in the notebook"
    assert capfd.readouterr().out == ""


def test_what_was_said_before_comes_first(capfd):
    with open(os.dup(1), "w") as stream, pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdout", stream)
        stream.write("a")  # and it stays in the buffer
        with lasting_streams():
            sys.stdout.write("b")
    assert capfd.readouterr().out == "ab"


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
