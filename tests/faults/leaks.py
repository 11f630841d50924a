"""Trains, and writes what the process holds after each replay: threads, and resident bytes."""

import json
import sys
from pathlib import Path

import psutil

from swarm_mj.cli import main
from swarm_mj.learning import callback

record, held = callback.record_replay, []


def record_and_look(*arguments):
    """Records a replay."""
    record(*arguments)
    process = psutil.Process()
    held.append((process.num_threads(), process.memory_info().rss))


callback.record_replay = record_and_look
code = main(sys.argv[1:])
Path("held.json").write_text(json.dumps(held))
sys.exit(code)
