"""The network where it learns; in flight it is that of `policies/residual/network.py`."""

from itertools import pairwise

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from residual_gnn.features import Neighbour, Own
from residual_gnn.network import OF_MESSAGES, Weights


class ResidualNetwork(nn.Module):
    """A network that changes nothing at first, so that the rule decides."""

    def __init__(self, width: int, prior_logit: float) -> None:
        """Make a network.

        Args:
            width: Of the layers.
            prior_logit: What the rule's own choice adds to the logit, or takes from it.
        """
        super().__init__()
        self.prior_logit = prior_logit
        own, other = len(Own), len(Neighbour)
        self.message = _layers(own + other, width, width)
        self.decision = _layers(2 * width + own, 2 * width, width)
        self.logit = nn.Linear(width, 1)
        nn.init.zeros_(self.logit.weight)
        nn.init.zeros_(self.logit.bias)

    def forward(
        self,
        robots: Float[Tensor, "R F"],
        neighbours: Float[Tensor, "E G"],
        owner: Int[Tensor, "E"],
    ) -> Float[Tensor, "R"]:
        """Return the logit of transmitting, for every robot that decides."""
        messages = self.message(torch.cat([neighbours, robots[owner]], dim=1))
        none = robots.new_zeros(len(robots), messages.shape[1])
        total = OF_MESSAGES * none.index_add(0, owner, messages)
        rows = owner[:, None].expand_as(messages)
        most = none.scatter_reduce(0, rows, messages, "amax")
        said = self.logit(self.decision(torch.cat([total, most, robots], dim=1))).squeeze(1)
        return said + self.prior_logit * robots[:, 0]

    def weights(self, *, corrects_turns: bool) -> Weights:
        """Return its weights, to fly with."""
        arrays = {name: t.detach().numpy().copy() for name, t in self.state_dict().items()}
        return Weights(arrays, self.prior_logit, corrects_turns)

    def state_dict_copy(self) -> dict[str, Tensor]:
        """Return a copy of its weights."""
        return {name: tensor.detach().clone() for name, tensor in self.state_dict().items()}


def _layers(*widths: int) -> nn.Sequential:
    layers = []
    for before, after in pairwise(widths):
        layers += [nn.Linear(before, after), nn.ReLU()]
    return nn.Sequential(*layers)
