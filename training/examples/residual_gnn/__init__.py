"""A policy of your own: a graph neural network corrects the plan of a stationary team.

    cd training/examples
    swarm-mj fly --policy residual_gnn:policy --task stationary --fading rayleigh

It uses the package's public interface only: `BroadcastPolicy`, `LocalViews`, `Belief`, and the
compiled pieces of the radio. `card.md` says how the weights were trained and what they achieve.
"""

from residual_gnn.factory import policy

__all__ = ["policy"]
