"""All that is known of a learned policy but its weights, as a config and, in words, as a card."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from swarm_mj.policies.gnn.feature_sets import check_fit, is_own_set
from swarm_mj.policies.gnn.shape import GnnShape
from swarm_mj.policies.mlp import MlpShape
from swarm_mj.system.fields import check, setting

SUFFIX = ".safetensors"  # of a stored policy's file
EDGES = {
    "paper": "parents hear their children",
    "reference": "children hear their parents",
    "both": "parents and children hear each other",
}


@dataclass(frozen=True, kw_only=True)
class PolicyConfig:
    """Where a stored network comes from, whatever its kind."""

    training: dict[str, Any]  # JSON: the settings, the seed, the budget spent, the command
    evaluation: dict[str, Any]  # JSON: what it cost on which missions
    commit: str | None  # the code that trained it
    version: str  # as above


@dataclass(frozen=True, kw_only=True)
class GnnConfig(PolicyConfig):
    """What a stored GNN's weights belong to, and where they come from.

    Raises:
        ValueError: The features are unknown or do not fit the network, or a number is out of range.
    """

    network: GnnShape
    features: str  # the name of a feature set, see `FEATURE_SETS`
    silence_logit: float = setting(0.0, low=-100.0, high=100.0)  # added, but in one's own turn

    def __post_init__(self) -> None:
        check(self)
        check_fit(self.network, self.features)


@dataclass(frozen=True, kw_only=True)
class MlpConfig(PolicyConfig):
    """What a stored plain network's weights belong to, and where they come from."""

    network: MlpShape

    @property
    def features(self) -> str:
        """The name of the feature set that it was trained on."""
        return self.network.features


def model_card(config: GnnConfig | MlpConfig) -> str:
    """Return a README in Markdown that says what the config holds, and nothing else.

    Of `training` and `evaluation` it lists every value, under dotted names; a text named `command`
    becomes a block.
    """
    training = dict(_flat(config.training))
    flags = next((v for k, v in training.items() if v and _is_text(k, v, "task")), "TASK")
    teams = "Teams of any size fly with it; those much larger than trained on may fare badly."
    if isinstance(config, MlpConfig):
        flags += f" --robots {config.network.num_robots}"
        teams = f"It flies teams of {config.network.num_robots} robots only."
    if is_own_set(config.features):
        flags += f" --features {config.features}"
    commit = f", commit {config.commit}" if config.commit else ""
    parts = [
        "# A learned communication policy of swarm_mj",
        "Every robot evaluates this network on its own buffer, and draws from the result whom it "
        "addresses in the next window, or that it stays silent.",
        _network(config),
        "## Fly it",
        f"    swarm-mj fly --policy FILE --task {flags}",
        "`FILE` is the `.safetensors` file that holds this card; `swarm-mj evaluate` takes it "
        f"too. {teams}",
        "## Training",
        *_described(training),
        f"By swarm_mj {config.version}{commit}.",
        "## Evaluation",
        *_described(dict(_flat(config.evaluation))),
        "## Licence",
        "Apache-2.0, as swarm_mj.",
    ]
    return "\n\n".join(parts) + "\n"


def _network(config: GnnConfig | MlpConfig) -> str:
    if isinstance(config, MlpConfig):
        widths = " and ".join(map(str, config.network.hidden)) or "no"
        kind = f"perceptrons, {widths} hidden units, {config.network.activation}"
    else:
        kind = "linear Aggregation GNN" if config.network.is_linear else "Aggregation GNN"
        kind += (
            f", receptive field {config.network.receptive_field}, width {config.network.latent}, "
            f"{config.network.depth} layers in each MLP; {EDGES[config.network.edges]}"
        )
    lines = [
        f"- network: {kind}",
        "- packets: T, M and P, as the paper's, and nothing more",
        f"- features: `{config.features}`, {config.network.num_features} for each robot",
    ]
    if isinstance(config, GnnConfig):
        exempt = " but in its own turn" if config.features == "extended" else ""
        lines.append(
            f"- outputs: {config.network.num_outputs} for each robot; {config.silence_logit:g} is "
            f"added to the logit of silence{exempt}"
        )
    return "\n".join(lines)


def _described(values: Mapping[str, Any]) -> Iterator[str]:
    """Paragraphs: a list of the values, then the commands among them."""
    if not values:
        yield "Nothing was noted."
    commands = {k: v for k, v in values.items() if _is_text(k, v, "command")}
    if listed := [f"- {k}: {_text(v)}" for k, v in values.items() if k not in commands]:
        yield "\n".join(listed)
    yield from ("    " + _one_line(command) for command in commands.values())


def _flat(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Values within objects, under dotted names."""
    for key, value in values.items():
        if isinstance(value, dict) and value:
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield _one_line(f"{prefix}{key}"), value


def _is_text(key: str, value: object, name: str) -> bool:
    """Whether a value under a dotted name is a text of this last name."""
    return key.rpartition(".")[2] == name and isinstance(value, str)


def _text(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    return _one_line(value if isinstance(value, str) else json.dumps(value))


def _one_line(text: str) -> str:
    return " ".join(text.split())
