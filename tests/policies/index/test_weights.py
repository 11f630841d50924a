"""The learned numbers: by name, in a row, and what they may be."""

import numpy as np
import pytest

from swarm_mj.policies.index.weights import (
    FEATURES,
    LEAST,
    MOST,
    NUMBERS,
    START,
    STEPS,
    Weights,
    as_tensors,
    by_name,
    flat,
    from_flat,
    from_names,
    from_tensors,
    repeated,
)


def same(first, second):
    """Whether two have the same numbers, field by field."""
    return all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))


def test_there_are_9_numbers_6_shifts_and_3_weights_for_each_of_10_features():
    assert len(FEATURES) == 10
    assert NUMBERS == 9 + 6 + 3 * 10
    assert [values.shape for values in START] == [values.shape for values in STEPS]


def test_numbers_in_a_row_and_by_name_are_the_same_numbers():
    assert same(from_flat(flat(START)), START)
    assert same(from_names(by_name(START)), START)
    assert same(
        from_tensors(as_tensors(from_tensors(as_tensors(START)))), from_tensors(as_tensors(START))
    )
    assert by_name(START)["in_index"]["age"] == START.in_index[0, FEATURES.index("age")]


@pytest.mark.parametrize("name", sorted(LEAST.keys() | MOST.keys()))
def test_a_number_beyond_what_it_may_be_is_moved_there(name):
    place = Weights._fields.index(name)
    for limits, far in ((LEAST, -1e6), (MOST, 1e6)):
        if name in limits:
            row = START._replace(**{name: np.array([[far]])})
            assert from_flat(flat(row))[place][0, 0] == np.float32(limits[name])


def test_the_size_of_the_team_is_no_reason_to_be_silent():
    row = START._replace(in_silence=np.ones((1, 10)))
    silence = from_flat(flat(row)).in_silence[0]
    assert silence[FEATURES.index("team")] == 0.0
    assert np.sum(silence) == 9.0


def test_each_row_flies_as_many_missions_one_by_one():
    two = from_flat(np.concatenate([flat(START), flat(START) * 0.99]))
    six = repeated(two, 6)
    assert six.first[:, 0].tolist() == [two.first[0, 0]] * 3 + [two.first[1, 0]] * 3
    with pytest.raises(ValueError, match="5 missions cannot fly as often by each of 2 rows"):
        repeated(two, 5)


def test_numbers_that_no_search_returns_are_refused_and_bounds_survive_storage():
    """A reach beyond the table's, no octaves, or silence by size: teams that never begin."""
    for name in ("octaves", "reach"):
        wrong = START._replace(**{name: np.array([[-1.0]])})
        with pytest.raises(ValueError, match=f"its {name} must be from"):
            from_tensors(as_tensors(wrong))
    by_size = START.in_silence.copy()
    by_size[0, FEATURES.index("team")] = 0.5
    with pytest.raises(ValueError, match="of the team's size in silence must be 0"):
        from_tensors(as_tensors(START._replace(in_silence=by_size)))
    at_bound = from_flat(flat(START._replace(reach=np.array([[2.0]]))))
    stored = from_tensors(as_tensors(at_bound))
    assert flat(from_flat(flat(stored))).tobytes() == flat(stored).tobytes()
