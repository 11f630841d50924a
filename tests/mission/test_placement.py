"""Initial positions against exact integer geometry, the graph's Laplacian and networkx."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm_mj.mission.placement import connected_positions, largest_part

points = st.lists(st.tuples(st.integers(-9, 9), st.integers(-9, 9)), min_size=1, max_size=12)


def disk_graph(position_m, range_m):
    """An edge wherever two robots are at most this far apart."""
    graph = nx.Graph()
    graph.add_nodes_from(range(len(position_m)))
    for i, (x, y) in enumerate(position_m):
        for j, (u, v) in enumerate(position_m[:i]):
            if (x - u) ** 2 + (y - v) ** 2 <= range_m**2:
                graph.add_edge(i, j)
    return graph


def algebraic_connectivity(graph):
    """The second smallest eigenvalue of the Laplacian; a lone robot has only one."""
    laplacian = nx.laplacian_matrix(graph).toarray().astype(float)
    return np.linalg.eigvalsh(laplacian)[1] if len(graph) > 1 else np.inf


# Integers make the boundary case, two robots at exactly the range, exact.
@given(position_m=points, range_m=st.integers(1, 9))
@settings(max_examples=200)
def test_connected_as_the_algebraic_connectivity_says(position_m, range_m):
    connected = largest_part(np.array(position_m, dtype=float), float(range_m)).all()
    graph = disk_graph(position_m, range_m)
    assert connected == nx.is_connected(graph)
    assert connected == (algebraic_connectivity(graph) > 1e-10)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("num_robots", "half_side_m"), [(2, 111.8), (10, 250.0), (40, 500.0)])
def test_positions_are_connected_and_in_the_area(num_robots, half_side_m, seed):
    position_m = connected_positions(num_robots, half_side_m, 250.0, np.random.default_rng(seed))
    assert position_m.shape == (num_robots, 2)
    assert (np.abs(position_m) <= half_side_m).all()
    assert nx.is_connected(disk_graph(position_m, 250.0))


@given(position_m=points, range_m=st.integers(1, 9))
@settings(max_examples=100)
def test_the_largest_part_is_one_of_the_largest(position_m, range_m):
    part = largest_part(np.array(position_m, dtype=float), float(range_m))
    parts = list(nx.connected_components(disk_graph(position_m, range_m)))
    assert set(np.flatnonzero(part).tolist()) in parts
    assert np.sum(part) == max(map(len, parts))


def test_of_a_large_team_only_those_apart_are_drawn_anew():
    """Of 2000 robots as dense as the paper's, hardly any team is connected at once."""
    half_side_m = np.sqrt(2000 / 40.0) * 500.0
    first_m = np.random.default_rng(3).uniform(-half_side_m, half_side_m, (2000, 2))
    assert not largest_part(first_m, 250.0).all()
    rng = np.random.default_rng(3)
    position_m = connected_positions(2000, half_side_m, 250.0, rng, keeps_largest=True)
    assert largest_part(position_m, 250.0).all()
    kept = largest_part(first_m, 250.0)
    np.testing.assert_array_equal(position_m[kept], first_m[kept])
    assert np.mean(kept) > 0.9


def test_positions_fill_the_area():
    # Uniform on ±500 m: mean 0, standard deviation 1000 / sqrt(12) = 288.7 m, on either axis.
    position_m = connected_positions(1000, 500.0, 5000.0, np.random.default_rng(0))
    assert position_m.mean(axis=0) == pytest.approx([0.0, 0.0], abs=30.0)
    assert position_m.std(axis=0) == pytest.approx([288.7, 288.7], abs=15.0)
    assert np.corrcoef(position_m.T)[0, 1] == pytest.approx(0.0, abs=0.1)


def test_disconnected_teams_are_redrawn_not_repaired():
    # Two points in a unit square are closer than d with probability pi d² - 8/3 d³ + d⁴/2, so of
    # the pairs within 0.2 a share of 0.0288 / 0.1051 = 0.274 lies within 0.1.
    rng = np.random.default_rng(0)
    pairs = np.stack([connected_positions(2, 0.5, 0.2, rng) for _ in range(1000)])
    distance = np.linalg.norm(pairs[:, 0] - pairs[:, 1], axis=-1)
    assert (distance <= 0.2).all()
    assert (distance <= 0.1).mean() == pytest.approx(0.274, abs=0.05)


def test_hopeless_density_is_an_error_that_says_what_to_do():
    with pytest.raises(ValueError, match=r"40 robots with a range of 0.5 m") as refusal:
        connected_positions(40, 500.0, 0.5, np.random.default_rng(0))
    assert "1000 m by 1000 m" in str(refusal.value)
    assert "raise the range ratio or the density" in str(refusal.value)


def parts(*largest):
    """A channel in which these are connected, ask by ask; and where the teams stood."""
    asked = []

    def largest_part(position_m):
        asked.append(position_m.copy())
        return np.array(largest[len(asked) - 1])

    return largest_part, asked


def test_a_team_is_redrawn_until_its_own_channel_connects_it():
    largest_part, asked = parts([True, False], [False, True], [True, True])
    drawn = connected_positions(2, 100.0, 1.0, np.random.default_rng(0), largest_part)
    np.testing.assert_array_equal(drawn, asked[2])
    assert len({*np.ravel(asked)}) == 12  # nobody stayed


def test_where_the_largest_part_is_kept_the_others_are_drawn_to_it():
    largest_part, asked = parts([True, True, False], [False, True, True], [True, True, True])
    rng = np.random.default_rng(0)
    drawn = connected_positions(3, 100.0, 1.0, rng, largest_part, keeps_largest=True)
    np.testing.assert_array_equal(asked[1][:2], asked[0][:2])
    np.testing.assert_array_equal(drawn[1:], asked[1][1:])
    assert np.all(asked[1][2] != asked[0][2])
    assert np.all(drawn[0] != asked[0][0])


@pytest.mark.parametrize("keeps_largest", [False, True])
def test_a_channel_that_connects_nobody_is_an_error_that_says_so(keeps_largest):
    def alone(_position_m):
        return np.arange(40) == 0

    rng = np.random.default_rng(0)
    said = r"40 robots with a range of 250 m in free space, .* are too sparse"
    with pytest.raises(ValueError, match=said):
        connected_positions(40, 500.0, 250.0, rng, alone, keeps_largest=keeps_largest)


def test_robots_that_touch_an_obstacle_are_drawn_anew_and_the_others_stay():
    rng = np.random.default_rng(3)
    plain_m = np.random.default_rng(3).uniform(-100.0, 100.0, (30, 2))
    drawn = connected_positions(
        30, 100.0, 500.0, rng, is_blocked_at=lambda position_m: position_m[:, 0] < 0.0
    )
    assert np.all(drawn[:, 0] >= 0.0)
    stays = plain_m[:, 0] >= 0.0
    np.testing.assert_array_equal(drawn[stays], plain_m[stays])


def test_an_area_without_free_space_is_an_error_that_says_so():
    with pytest.raises(ValueError, match=r"5 of 5 robots found no free space in 1000 draws"):
        connected_positions(
            5, 9.0, 99.0, np.random.default_rng(0), is_blocked_at=lambda p: np.ones(len(p), bool)
        )
