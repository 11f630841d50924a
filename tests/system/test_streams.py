"""Streams as they are replaced; tests/faults/test_signals.py takes their readers away."""

import io
import os
import sys

import pytest

from swarm_mj.system.streams import lasting_streams


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


def test_what_is_said_arrives_in_order_and_as_it_was(capfd):
    with open(os.dup(1), "w") as stream, pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdout", stream)
        stream.write("a")  # and it stays in the buffer
        with lasting_streams():
            sys.stdout.write("ä")
            assert sys.stdout.encoding == stream.encoding
        assert sys.stdout is stream
        os.write(1, b"b")
    assert capfd.readouterr().out == "aäb"


def test_streams_that_lead_to_no_file_are_left_alone(capsys):
    with lasting_streams():
        sys.stdout.write("heard\n")
    assert capsys.readouterr().out == "heard\n"
