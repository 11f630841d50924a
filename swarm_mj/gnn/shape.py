"""What an Aggregation GNN is made of, and what it can be given."""

from dataclasses import dataclass
from typing import Literal, get_args

from torch import Tensor

Edges = Literal["paper", "reference", "both"]


@dataclass(frozen=True, kw_only=True)
class GnnShape:
    """What an Aggregation GNN is made of.

    Raises:
        ValueError: A number is out of its range, or the edges have no such name.
    """

    num_features: int  # F: numbers per node
    num_outputs: int = 1  # O: numbers per node that come out
    latent: int = 64  # width of every layer
    depth: int = 3  # layers of every perceptron, with a ReLU after all but the last
    receptive_field: int = 5  # K: how often the one shared GN block is applied
    is_linear: bool = False  # GN(v) = A v with the mean-normalised adjacency A
    edges: Edges = "paper"  # paper: parents hear children; reference: children hear parents

    def __post_init__(self) -> None:
        for name, low, high in (
            ("num_features", 1, 1024),
            ("num_outputs", 1, 1024),
            ("latent", 1, 1024),
            ("depth", 1, 8),
            ("receptive_field", 0, 16),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ValueError(f"{name} must be from {low} to {high}, not {value}")
        if self.edges not in get_args(Edges):
            names = ", ".join(get_args(Edges))
            raise ValueError(f"edges must be one of {names}, not {self.edges!r}")

    @property
    def has_core(self) -> bool:
        """Whether there is a GN block with something to learn."""
        return self.receptive_field > 0 and not self.is_linear

    def check(self, node: Tensor, parent: Tensor) -> None:
        """Raises ValueError on what would give numbers without a meaning."""
        num_features, num_nodes = node.shape[-1], parent.shape[-1]
        if num_features != self.num_features:
            raise ValueError(
                f"nodes must have the {self.num_features} features that the network was made for, "
                f"not {num_features}"
            )
        if parent.numel() and (highest := int(parent.max())) >= num_nodes:
            raise ValueError(
                f"a parent must be one of its graph's nodes, 0 to {num_nodes - 1}, or -1 for "
                f"none, not {highest}"
            )
