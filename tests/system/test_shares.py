import pytest

from swarm_mj.system.shares import percent


@pytest.mark.parametrize(
    ("count", "of", "shown"),
    [
        (0, 7, "0%"),
        (1, 1000, "<1%"),
        (6, 1000, "1%"),
        (1, 4, "25%"),
        (994, 1000, "99%"),
        (672, 675, ">99%"),
        (7, 7, "100%"),
    ],
)
def test_only_all_is_100_per_cent_and_only_nothing_is_0(count, of, shown):
    assert percent(count / of) == shown
