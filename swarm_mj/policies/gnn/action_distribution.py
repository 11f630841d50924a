"""From a network's numbers to logits over recipients, silence among them (III-C)."""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from swarm_mj.policies.gnn.sampling import IMPOSSIBLE


def recipient_logits(
    output: Float[Tensor, "R N O"],
    owner: Int[Tensor, "R"],
    may_address: Bool[Tensor, "R N"],
    silence_logit: float = 0.0,
    has_turn: Bool[Tensor, "R"] | None = None,
) -> Float[Tensor, "R N"]:
    """Logits over whom each robot addresses; oneself is silence (III-C).

    With one number per node it is the node's logit. With two, as in the authors' code, they are the
    logits of addressing it at full and at zero power; all that send nothing count together.

    Args:
        output: The network's numbers, O is 1 or 2.
        owner: The robot of each row.
        may_address: Recipients to choose among; the owner's own entry is always one.
        silence_logit: Added to silence.
        has_turn: Whose turn it is, so that nothing is added to their silence; None is nobody.

    Returns:
        The logits; `IMPOSSIBLE` where `may_address` is False.
    """
    own = owner[:, None]
    logits = output[:, :, 0]
    if output.shape[2] > 1:  # the authors' second number: of sending at no power, hence of silence
        zero_power = output[:, :, 1].masked_fill(~may_address, IMPOSSIBLE)
        unsent = torch.cat([zero_power, logits.gather(1, own)], dim=1)
        logits = logits.scatter(1, own, torch.logsumexp(unsent, dim=1, keepdim=True))
    if silence_logit:
        bias = torch.full_like(own, silence_logit, dtype=logits.dtype)
        if has_turn is not None:
            bias = bias.masked_fill(has_turn[:, None], 0.0)
        logits = logits.scatter_add(1, own, bias)
    return logits.masked_fill(~may_address, IMPOSSIBLE)
