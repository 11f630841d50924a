"""The layers of an Aggregation GNN, as settings."""

from dataclasses import dataclass
from typing import Literal, get_args

from swarm_mj.system.fields import check, setting

Edges = Literal["paper", "reference", "both"]


@dataclass(frozen=True, kw_only=True)
class GnnShape:
    """The layers of an Aggregation GNN; raises ValueError for what is out of range or unknown."""

    num_features: int = setting(low=1, high=1024)  # F: numbers per node
    num_outputs: int = setting(1, low=1, high=1024)  # O: numbers per node that come out
    latent: int = setting(64, "width of every layer", low=1, high=1024)
    depth: int = setting(3, "layers of every MLP, a ReLU after all but the last", low=1, high=8)
    receptive_field: int = setting(
        5, "K: how often the one shared GN block is applied", low=0, high=16
    )
    # GN(v) = A v with the mean-normalised adjacency A
    is_linear: bool = setting(False, "the linear variant: no perceptrons in the GN block")
    # paper: parents hear children; reference: children hear parents
    edges: Edges = setting(
        "paper",
        "edges from children to parents as in the text, back as in the authors' code, or both",
        choices=get_args(Edges),
    )

    def __post_init__(self) -> None:
        check(self)

    @property
    def has_core(self) -> bool:
        """True if there is a GN block with something to learn."""
        return self.receptive_field > 0 and not self.is_linear
