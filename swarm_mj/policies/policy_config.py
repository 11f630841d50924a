"""The config of a stored network, all but its weights, and a card for readers."""

import json
from dataclasses import asdict, dataclass
from typing import Any

from swarm_mj.policies.gnn.feature_sets import check_fit, is_own_set
from swarm_mj.policies.gnn.shape import GnnShape
from swarm_mj.policies.mlp import MlpShape
from swarm_mj.system.fields import check, setting

SUFFIX = ".safetensors"  # of a stored policy's file


@dataclass(frozen=True, kw_only=True)
class PolicyConfig:
    """The origin of a stored network, whatever its kind."""

    training: dict[str, Any]  # JSON: the mission, the settings, the budget spent, the command
    evaluation: dict[str, Any]  # JSON: what it cost on which missions
    commit: str | None  # the code that trained it
    version: str  # as above


@dataclass(frozen=True, kw_only=True)
class GnnConfig(PolicyConfig):
    """All of a stored GNN but its weights; raises ValueError for what does not fit together."""

    network: GnnShape
    features: str  # the name of a feature set, see `FEATURE_SETS`
    silence_logit: float = setting(0.0, low=-100.0, high=100.0)  # added, but in one's own turn

    def __post_init__(self) -> None:
        check(self)
        check_fit(self.network, self.features)


@dataclass(frozen=True, kw_only=True)
class MlpConfig(PolicyConfig):
    """All of a stored plain network but its weights."""

    network: MlpShape

    @property
    def features(self) -> str:
        """The name of the feature set that it was trained on."""
        return self.network.features


def model_card(config: GnnConfig | MlpConfig) -> str:
    """Return a README in Markdown: how to fly the policy, and all that the config holds."""
    flags = config.training.get("mission", {}).get("task", "TASK")
    kind = "a graph neural network (an Aggregation GNN)"
    teams = "Teams of any size fly with it; those much larger than trained on may fare badly."
    if isinstance(config, MlpConfig):
        flags += f" --robots {config.network.num_robots}"
        kind = "perceptrons"
        teams = f"It flies teams of {config.network.num_robots} robots only."
    if is_own_set(config.features):
        flags += f" --features {config.features}"
    return f"""\
# A learned communication policy of swarm_mj

Every robot evaluates {kind} on the `{config.features}` features of its own
buffer, and draws from the result which robot it addresses in the next window, or that it stays
silent. Packets carry T, M and P, as the paper's, and nothing more.

    swarm-mj fly --policy FILE --task {flags}

`FILE` is the `{SUFFIX}` file that holds this card; `swarm-mj evaluate` takes it too.
{teams}

```json
{json.dumps(asdict(config), indent=2)}
```

Licence: Apache-2.0, as swarm_mj.
"""
