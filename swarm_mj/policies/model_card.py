"""The card of a stored policy, for whoever finds it: what it is, where it comes from, its costs."""

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from swarm_mj.policies.gnn.feature_sets import is_own_set
from swarm_mj.policies.mlp import MlpShape
from swarm_mj.policies.policy_config import PolicyConfig

EDGES = {
    "paper": "parents hear their children",
    "reference": "children hear their parents",
    "both": "parents and children hear each other",
}


def model_card(config: PolicyConfig) -> str:
    """Return a README in Markdown that says what the config holds, and nothing else.

    Of `training` and `evaluation` it lists every value, under dotted names; a text named `command`
    becomes a block.
    """
    training = dict(_flat(config.training))
    commit = f", commit {config.commit}" if config.commit else ""
    return _card(
        _network(config),
        sees="its own buffer, seen as a graph",
        flags=f"--task {_task(training)}{_own_features(config.features)}",
        teams="Teams of any size fly with it; those much larger than the ones it was trained on "
        "may fare badly.",
        training=training,
        origin=f"By swarm_mj {config.version}{commit}.",
        rest=[
            "## Evaluation",
            *_described(dict(_flat(config.evaluation))),
            "## Licence",
            "Apache-2.0, as swarm_mj.",
        ],
    )


def mlp_card(shape: MlpShape, training: Mapping[str, Any], version: str) -> str:
    """As `model_card`, for a plain network; the version is that of swarm_mj that stored it."""
    widths = " and ".join(map(str, shape.hidden)) or "no"
    noted = dict(_flat(training))
    return _card(
        f"- network: perceptrons, {widths} hidden units, {shape.activation}\n"
        "- packets: T, M and P, as the paper's, and nothing more\n"
        f"- features: `{shape.features}`, {shape.num_features} for each robot",
        sees="what it knows of its teammates",
        flags=f"--task {_task(noted)} --robots {shape.num_robots}{_own_features(shape.features)}",
        teams=f"It flies teams of {shape.num_robots} robots only.",
        training=noted,
        origin=f"Stored by swarm_mj {version}.",
    )


def _card(
    network: str,
    *,
    sees: str,
    flags: str,
    teams: str,
    training: Mapping[str, Any],
    origin: str,
    rest: Iterable[str] = (),
) -> str:
    """What every card says, about a network that is listed so."""
    parts = [
        "# A learned communication policy of swarm_mj",
        f"Every robot evaluates this network on {sees}, and draws from the result whom it "
        "addresses in the next window, or that it stays silent.",
        network,
        "## Fly it",
        f"    swarm-mj fly --policy DIR {flags}",
        f"`DIR` is this folder; `swarm-mj evaluate` takes it too. {teams}",
        "## Training",
        *_described(training),
        origin,
        *rest,
    ]
    return "\n\n".join(parts) + "\n"


def _task(training: Mapping[str, Any]) -> str:
    """Return the task that a network was trained on, if that is known."""
    return next((v for k, v in training.items() if v and _is_text(k, v, "task")), "TASK")


def _own_features(features: str) -> str:
    """What the command needs as well if the features are somebody's own."""
    return f" --features {features}" if is_own_set(features) else ""


def _network(config: PolicyConfig) -> str:
    shape = config.network
    kind = "linear Aggregation GNN" if shape.is_linear else "Aggregation GNN"
    return (
        f"- network: {kind}, receptive field {shape.receptive_field}, width {shape.latent}, "
        f"{shape.depth} layers in each MLP; {EDGES[shape.edges]}\n"
        "- packets: T, M and P, as the paper's, and nothing more\n"
        f"- features: `{config.features}`, {shape.num_features} for each robot\n"
        f"- outputs: {shape.num_outputs} for each robot; {config.silence_logit:g} is added to the "
        "logit of silence" + (" but in its own turn" if config.features == "extended" else "")
    )


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
