"""Edges and the means over them, by hand: 0 is the parent of 1, 2 and 3, 4 is unknown."""

import pytest
import torch

from swarm_mj.gnn.edges import EdgeSet

PARENT = torch.tensor([[-1, 0, 0, 0, -1]])
TENS = torch.tensor([[10.0], [20.0], [30.0], [40.0], [50.0]])
ONES = torch.tensor([[1.0], [2.0], [3.0], [4.0], [5.0]])


def edge_set(edges, parent=PARENT):
    return EdgeSet(parent, edges, TENS)


@pytest.mark.parametrize(
    ("edges", "sums"),
    [
        ("paper", [12.0, 13.0, 14.0]),  # receiver 0 in tens, senders 1, 2, 3 in ones
        ("reference", [21.0, 31.0, 41.0]),
        ("both", [12.0, 13.0, 14.0, 21.0, 31.0, 41.0]),
    ],
)
def test_an_edge_has_a_receiver_and_a_sender(edges, sums):
    found = edge_set(edges).from_ends(TENS, ONES).flatten().tolist()
    assert found[1:4] + found[6:9] == sums


def test_an_edge_copies_its_sender():
    assert edge_set("paper").from_senders(ONES).flatten().tolist()[1:4] == [2.0, 3.0, 4.0]
    assert edge_set("reference").from_senders(ONES).flatten().tolist()[1:4] == [1.0, 1.0, 1.0]


@pytest.mark.parametrize(
    ("edges", "edge", "means"),
    [
        ("paper", [7.0, 1.0, 2.0, 6.0, 7.0], [3.0, 0.0, 0.0, 0.0, 0.0]),
        ("reference", [7.0, 1.0, 2.0, 6.0, 7.0], [0.0, 1.0, 2.0, 6.0, 0.0]),
        (
            "both",
            [7.0, 1.0, 2.0, 6.0, 7.0, 7.0, 4.0, 8.0, 9.0, 7.0],
            [3.0, 4.0, 8.0, 9.0, 0.0],
        ),
    ],
)
def test_eq12_the_mean_is_over_the_edges_received(edges, edge, means):
    found = edge_set(edges).add_mean_(TENS.clone(), torch.tensor(edge)[:, None]) - TENS
    assert found.flatten().tolist() == means


def test_eq12_in_both_directions_parents_and_children_count_alike():
    """Node 1 hears its parent 0 and its child 2: the mean of two edges."""
    chain = torch.tensor([[-1, 0, 1]])
    upward, downward = [0.0, 5.0, 7.0], [0.0, 3.0, 1.0]  # of the edges of children 1 and 2
    edge = torch.tensor(upward + downward)[:, None]
    found = EdgeSet(chain, "both", edge).add_mean_(torch.zeros(3, 1), edge)
    assert found.flatten().tolist() == [5.0, (7.0 + 3.0) / 2, 1.0]


def test_graphs_lie_one_after_the_other():
    two = edge_set("reference", torch.tensor([[-1, 0], [1, -1]]))
    rows = torch.tensor([[1.0], [2.0], [3.0], [4.0]])
    found = two.add_mean_(torch.zeros(4, 1), two.from_senders(rows))
    assert found.flatten().tolist() == [0.0, 1.0, 4.0, 0.0]
