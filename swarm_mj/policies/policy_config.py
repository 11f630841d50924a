"""The config of a stored network, all but its weights: shape, features, origin; and its card."""

import itertools
import json
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

import numpy as np

from swarm_mj.policies.gnn.feature_sets import is_own_set, num_features, uses
from swarm_mj.policies.index.weights import START
from swarm_mj.system.fields import check, setting
from swarm_mj.system.streams import check_printable

SUFFIX = ".safetensors"  # of a stored policy's file
Edges = Literal["paper", "reference", "both"]
Activation = Literal["tanh", "relu"]
Tensors = dict[str, np.ndarray]  # by name
# Of the probability of speech: with the one, any is allowed; with 0, robots could never speak.
NO_BOUND = 1.0
LEAST_BOUND = 1e-9


@dataclass(frozen=True, kw_only=True)
class GnnShape:
    """The layers of an Aggregation GNN; raises ValueError for what is out of range or unknown."""

    num_features: int = setting(low=1, high=1024)  # F: numbers per node
    num_outputs: int = setting(1, low=1, high=1024)  # O: numbers per node that come out
    latent: int = setting(64, "width of every layer", low=1, high=1024)
    depth: int = setting(3, "layers of each MLP", low=1, high=8)
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

    @property
    def tensors(self) -> dict[str, tuple[int, ...]]:
        """The weights' shapes by name: weights are [Out, In], biases [Out]."""
        num_inputs = {"encoder.node": self.num_features, "decoder.node": self.latent}
        if self.has_core:
            num_inputs["encoder.edge"] = 1
            num_inputs["core.edge"] = 3 * self.latent
            num_inputs["core.node"] = 2 * self.latent
        shapes: dict[str, tuple[int, ...]] = {}
        for perceptron, first in num_inputs.items():
            for layer in range(self.depth):
                before = first if layer == 0 else self.latent
                shapes[f"{perceptron}.{layer}.weight"] = (self.latent, before)
                shapes[f"{perceptron}.{layer}.bias"] = (self.latent,)
        stages = self.receptive_field + 1
        shapes["output.weight"] = (self.num_outputs, stages * self.latent)
        shapes["output.bias"] = (self.num_outputs,)
        return shapes


@dataclass(frozen=True, kw_only=True)
class MlpShape:
    """The layers of a plain network; raises ValueError for what is unknown or out of range."""

    num_robots: int = setting(low=2, high=1000)  # N: of the one team size that it flies
    features: str  # the name of a feature set, see `FEATURE_SETS`
    num_features: int = setting(low=1, high=1024)  # F: numbers per teammate
    hidden: tuple[int, ...] = setting(low=1, high=4096)  # widths of the layers but the last
    activation: Activation = setting(choices=get_args(Activation))  # after all layers but the last
    obeys_mask: bool  # whether it addresses only recipients that the features allow

    def __post_init__(self) -> None:
        check(self)
        _check_num_features(self.num_features, self.features)

    @property
    def tensors(self) -> dict[str, tuple[int, ...]]:
        """The weights' shapes by name: `0.weight` [Out, In] and `0.bias` [Out] first."""
        widths = [self.num_robots * (1 + self.num_features), *self.hidden, self.num_robots]
        shapes: dict[str, tuple[int, ...]] = {}
        for layer, (before, after) in enumerate(itertools.pairwise(widths)):
            shapes[f"{layer}.weight"] = (after, before)
            shapes[f"{layer}.bias"] = (after,)
        return shapes


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
    own_network: str = ""  # the name of its class, as `module:Name`, if it is a user's own
    # The probability with which a robot speaks at most, but in its own turn.
    most_speech: float = setting(NO_BOUND, low=LEAST_BOUND, high=NO_BOUND)

    def __post_init__(self) -> None:
        check(self)
        check_fit(self.network, self.features)
        check_printable(self.own_network, "write it without them")


@dataclass(frozen=True, kw_only=True)
class MlpConfig(PolicyConfig):
    """All of a stored plain network but its weights."""

    network: MlpShape

    @property
    def features(self) -> str:
        """The name of the feature set that it was trained on."""
        return self.network.features


@dataclass(frozen=True, kw_only=True)
class IndexConfig(PolicyConfig):
    """All of the stored numbers of an `index-csma` but the numbers."""

    @property
    def tensors(self) -> dict[str, tuple[int, ...]]:
        """The numbers' shapes by name: those of a row of `index.weights.Weights`."""
        return {name: values.shape[1:] for name, values in START._asdict().items()}


StoredConfig = GnnConfig | MlpConfig | IndexConfig


def check_fit(network: GnnShape, features: str) -> None:
    """Raise ValueError unless a network takes a feature set, and gives what decisions need."""
    _check_num_features(network.num_features, features)
    if network.num_outputs not in (1, 2):
        raise ValueError(f"network.num_outputs must be 1 or 2, not {network.num_outputs}")


def _check_num_features(given: int, features: str) -> None:
    # A user's own set is not imported, as its name may stand in a file: it may have any number.
    if is_own_set(features):
        check_printable(features, "write it without them")
        return
    expected = num_features(features)
    if given != expected:
        raise ValueError(
            f"network.num_features is {given}, but the {features} features are {expected}"
        )


def model_card(config: StoredConfig) -> str:
    """Return a README in Markdown: how to fly the policy, and all that the config holds."""
    said = _index_said() if isinstance(config, IndexConfig) else _network_said(config)
    return f"""\
# A learned communication policy of swarm_mj

{said}

```json
{json.dumps(asdict(config), indent=2)}
```

Licence: Apache-2.0, as swarm_mj.
"""


def _index_said() -> str:
    """Return what a card says of the numbers of `index-csma`."""
    return f"""\
Every robot listens before it transmits, in the order of an index, as those of `index-csma` do; the
file holds the index's numbers. Packets carry T, M and P, as the paper's, and nothing more.

    swarm-mj fly --policy FILE --task stationary

`FILE` is the `{SUFFIX}` file that holds this card; `swarm-mj evaluate` takes it too.
Teams of any size fly with it; those unlike the ones that it was trained on may fare badly."""


def _network_said(config: GnnConfig | MlpConfig) -> str:
    """Return what a card says of a network."""
    kind = "a graph neural network (an Aggregation GNN)"
    teams = "Teams of any size fly with it; those much larger than trained on may fare badly."
    flags = [config.training.get("mission", {}).get("task", "TASK")]
    if isinstance(config, MlpConfig):
        kind = "perceptrons"
        teams = f"It flies teams of {config.network.num_robots} robots only."
        flags.append(f"--robots {config.network.num_robots}")
    if isinstance(config, GnnConfig) and config.own_network:
        kind = f"a network, `{config.own_network}`,"
        flags.append(f"--network {config.own_network}")
    if is_own_set(config.features):
        flags.append(f"--features {config.features}")
    known = "" if is_own_set(config.features) else f" It knows {uses(config.features)}."
    return f"""\
Every robot evaluates {kind} on the `{config.features}` features of its own
buffer, and draws from the result which robot it addresses in the next window, or that it stays
silent.{known}
Packets carry T, M and P, as the paper's, and nothing more.

    swarm-mj fly --policy FILE --task {" ".join(flags)}

`FILE` is the `{SUFFIX}` file that holds this card; `swarm-mj evaluate` takes it too.
{teams}"""
