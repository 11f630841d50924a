"""Checkpoints of a search: what is written comes back, and what is damaged is refused."""

from dataclasses import asdict

import numpy as np
import pytest

from swarm_mj.learning import evolution, index_checkpoint
from swarm_mj.learning.index_checkpoint import State
from swarm_mj.learning.selection import Progress
from swarm_mj.learning.settings import usual_index_settings
from swarm_mj.mission import paper
from swarm_mj.policies.index.weights import NUMBERS, START, flat

TRAINING = usual_index_settings(paper("stationary"), (5,))


def test_a_search_and_its_generator_go_on_to_the_last_bit(tmp_path):
    rng = np.random.default_rng(7)
    search = evolution.begin(NUMBERS, 0.5)
    for _ in range(3):
        candidates = evolution.ask(search, 12, rng)
        evolution.tell(search, candidates, candidates[:, 0])
    state = State(progress=Progress(decisions=40), search=search, kept={40: START})
    index_checkpoint.save(tmp_path / "c", TRAINING, state, rng)
    other = np.random.default_rng(0)
    found = index_checkpoint.load(tmp_path / "c", TRAINING, other)
    assert other.bit_generator.state == rng.bit_generator.state
    for name, value in asdict(search).items():
        assert np.array_equal(value, getattr(found.search, name)), name
    assert found.progress == state.progress
    assert flat(found.kept[40]).tolist() == flat(START).tolist()


def test_a_damaged_checkpoint_is_refused_in_a_line(tmp_path):
    rng = np.random.default_rng(7)
    state = State(progress=Progress(), search=evolution.begin(NUMBERS, 0.5), kept={})
    index_checkpoint.save(tmp_path / "c", TRAINING, state, rng)
    content = bytearray((tmp_path / "c").read_bytes())
    content[len(content) // 2] ^= 255
    (tmp_path / "c").write_bytes(content)
    with pytest.raises(ValueError, match=r"checkpoint .*c is damaged, or none; begin a new run"):
        index_checkpoint.load(tmp_path / "c", TRAINING, rng)
