"""The learned policy that comes with the package, `gnn`: what it says of itself.

It is a stored `GnnPolicy` like those that users train, so its class cannot say it; its features and
weights are those of the file in `assets/policies/`.
"""

from swarm_mj.policies.about import FEW_BYTES, FromPaper, Information, Listed, Look
from swarm_mj.policies.gnn.turn_features import TurnFeatures

SHIPPED_GNN = Listed(
    name="gnn",
    origin=FromPaper(section="III"),
    rank=150,
    uses=f"{TurnFeatures.uses}, by a trained graph neural network",
    beyond=(Information.OBSERVED_POSITIONS, Information.RADIO_CONSTANTS),
    payload=None,
    look=Look(label="gnn", colour="#d55e00", marker="*", marker_size=8.0),
    memory=FEW_BYTES,  # beside what `simulation.memory` counts for every learned policy
)
