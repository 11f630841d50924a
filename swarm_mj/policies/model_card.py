"""The card of a stored policy, for whoever finds it: what it is, where it comes from, its costs."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from swarm_mj.policies.policy_config import PolicyConfig

EDGES = {
    "paper": "parents hear their children",
    "reference": "children hear their parents",
    "both": "parents and children hear each other",
}


def model_card(config: PolicyConfig) -> str:
    """A README in Markdown that says what the config holds, and nothing else.

    Of `training` and `evaluation` it lists every value, under dotted names; a text named `command`
    becomes a block.
    """
    training = dict(_flat(config.training))
    task = next((v for k, v in training.items() if v and _is_text(k, v, "task")), "TASK")
    commit = f", commit {config.commit}" if config.commit else ""
    parts = [
        "# A learned communication policy of swarm_mj",
        _network(config),
        "## Fly it",
        f"    swarm-mj fly --policy DIR --task {task}",
        "`DIR` is this folder; `swarm-mj evaluate` takes it too. Teams of any size fly with it; "
        "those much larger than the ones it was trained on may fare badly.",
        "## Training",
        *_described(training),
        f"By swarm_mj {config.version}{commit}.",
        "## Evaluation",
        *_described(dict(_flat(config.evaluation))),
        "## Licence",
        "Apache-2.0, as swarm_mj.",
    ]
    return "\n\n".join(parts) + "\n"


def _network(config: PolicyConfig) -> str:
    shape = config.network
    kind = "linear Aggregation GNN" if shape.is_linear else "Aggregation GNN"
    return (
        "Every robot evaluates this network on its own buffer, seen as a graph, and draws from the "
        "result whom it addresses in the next window, or that it stays silent.\n\n"
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
