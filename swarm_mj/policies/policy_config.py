"""What a policy's `config.json` says: how to make its network, and where it comes from."""

import json
from dataclasses import asdict, dataclass
from typing import Any

from swarm_mj.policies.gnn.feature_sets import check_fit
from swarm_mj.policies.gnn.shape import GnnShape
from swarm_mj.system.fields import check, setting
from swarm_mj.system.reading import read_document

FORMAT = "swarm_mj policy"
FORMAT_VERSION = 1


@dataclass(frozen=True, kw_only=True)
class PolicyConfig:
    """All of a policy but its weights.

    Raises:
        ValueError: The features are unknown or do not fit the network, or a number is out of range.
    """

    network: GnnShape
    features: str  # the name of a feature set, see `FEATURE_SETS`
    silence_logit: float = setting(0.0, low=-100.0, high=100.0)  # added, but in one's own turn
    training: dict[str, Any]  # JSON: the settings, the seed, the budget spent, the command
    evaluation: dict[str, Any]  # JSON: what it cost on which missions
    commit: str | None  # the code that trained it
    version: str  # as above

    def __post_init__(self) -> None:
        check(self)
        check_fit(self.network, self.features)


def to_json(config: PolicyConfig) -> str:
    """Return the text of a `config.json`.

    Raises:
        ValueError: `from_json` would not take it: something in it is no JSON, or no finite number.
    """
    document = {"format": FORMAT, "format_version": FORMAT_VERSION, **asdict(config)}
    try:
        text = json.dumps(document, indent=2, allow_nan=False) + "\n"
    except (TypeError, ValueError, RecursionError) as error:
        raise ValueError(f"config must be JSON all through: {error}") from error
    from_json(text)
    return text


def from_json(text: str | bytes) -> PolicyConfig:
    """What the text of a `config.json` says.

    Raises:
        ValueError: It is no JSON, not this format, of a newer version, or a value is unknown,
            missing, of another kind or out of range.
    """
    return read_document(text, FORMAT, FORMAT_VERSION, PolicyConfig)
