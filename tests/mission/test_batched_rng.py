"""Streams against each mission's generator drawing alone, one draw at a time."""

import numpy as np
import pytest

from swarm_mj.mission.batched_rng import BLOCK, Stream, check_seeds, normal, streams_of, uniform

SEEDS = [3, 1, 4, 15]
LENGTH = 2 * BLOCK + 5  # over two borders of the blocks drawn ahead


def generators(seeds):
    return [np.random.default_rng(seed) for seed in seeds]


def take(stream, length=LENGTH):
    return np.stack([stream.next().copy() for _ in range(length)])


@pytest.mark.parametrize("shape", [(), (6,), (5, 2)])
@pytest.mark.parametrize(
    ("draw", "alone"),
    [(uniform, np.random.Generator.random), (normal, np.random.Generator.standard_normal)],
)
def test_a_mission_sees_what_its_generator_alone_gives(draw, alone, shape):
    drawn = take(Stream(generators(SEEDS), draw, shape))
    assert drawn.shape == (LENGTH, len(SEEDS), *shape)
    for b, rng in enumerate(generators(SEEDS)):
        for t in range(LENGTH):
            assert (drawn[t, b] == alone(rng, shape)).all()


def test_the_laws_of_the_draws():
    rng = np.random.default_rng(0)
    flat, bell = uniform(rng, (200, 200)), normal(rng, (200, 200))
    # Uniform: mean 1/2, variance 1/12. Normal: mean 0, variance 1, 68.3 % within one deviation.
    assert 0.0 <= flat.min() < flat.max() < 1.0
    assert (flat.mean(), flat.var()) == pytest.approx((0.5, 1 / 12), abs=0.01)
    assert (bell.mean(), bell.var()) == pytest.approx((0.0, 1.0), abs=0.03)
    assert (np.abs(bell) < 1.0).mean() == pytest.approx(0.683, abs=0.01)


@pytest.mark.parametrize("seed", [0, 7, 2**62])
def test_streams_that_were_added_later_changed_no_other(seed):
    """A mission's first three streams are those of a seed that spawns no more than three."""
    three = [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(3)]
    streams = [rng for (rng,) in streams_of([seed])]
    assert len(streams) == 9  # the last are localisation's, sensing's, bodies' and pilots'
    for stream, expected in zip(streams[:3], three, strict=True):
        assert stream.random(4).tolist() == expected.random(4).tolist()
    drawn = [rng.random() for rng in (*three, *streams[3:])]
    assert len(set(drawn)) == len(drawn)


def test_true_is_no_seed():
    with pytest.raises(ValueError, match="integers from 0"):
        check_seeds([True])
