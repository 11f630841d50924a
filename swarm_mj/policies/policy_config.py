"""What a policy's `config.json` says: how to make its network, and where it comes from."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from types import NoneType
from typing import Any, get_args

from swarm_mj.gnn.feature_sets import make_extractor
from swarm_mj.gnn.shape import GnnShape
from swarm_mj.mission import Mission

FORMAT = "swarm_mj policy"
FORMAT_VERSION = 1
MAX_SILENCE_LOGIT = 100.0  # either way; e^100 to one is certain
# What JSON calls the types of Python that it comes as.
KINDS: dict[Any, str] = {
    int: "a whole number",
    float: "a number",
    bool: "true or false",
    str: "a text",
    dict: "an object",
    list: "a list",
    NoneType: "null",
}
ITS_KINDS: dict[str, tuple[Any, ...]] = {
    "network": (dict,),
    "features": (str,),
    "silence_logit": (float, int),
    "training": (dict,),
    "evaluation": (dict,),
    "commit": (str, NoneType),
    "version": (str,),
}
# A field's type is its kind; a Literal's arguments are texts to choose from.
CHOICES = {spec.name: get_args(spec.type) for spec in fields(GnnShape) if get_args(spec.type)}
NETWORK_KINDS = {s.name: (str,) if s.name in CHOICES else (s.type,) for s in fields(GnnShape)}


@dataclass(frozen=True, kw_only=True)
class PolicyConfig:
    """All of a policy but its weights.

    Raises:
        ValueError: The features are unknown or do not fit the network, or a number is out of range.
    """

    network: GnnShape
    features: str  # the name of a feature set, see `make_extractor`
    silence_logit: float = 0.0  # added to silence, but in a robot's own turn
    training: dict[str, Any]  # JSON: the settings, the seed, the budget spent, the command
    evaluation: dict[str, Any]  # JSON: what it cost on which missions
    commit: str | None  # the code that trained it
    version: str  # as above

    def __post_init__(self) -> None:
        num_features = len(make_extractor(self.features, Mission()).names)
        if self.network.num_features != num_features:
            raise ValueError(
                f"network.num_features is {self.network.num_features}, but the {self.features} "
                f"features are {num_features}"
            )
        if self.network.num_outputs not in (1, 2):
            raise ValueError(f"network.num_outputs must be 1 or 2, not {self.network.num_outputs}")
        if not abs(self.silence_logit) <= MAX_SILENCE_LOGIT:
            raise ValueError(
                f"silence_logit must be from -{MAX_SILENCE_LOGIT:g} to {MAX_SILENCE_LOGIT:g}, not "
                f"{self.silence_logit:g}"
            )


def to_json(config: PolicyConfig) -> str:
    """The text of a `config.json`.

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
    content = _parsed(text)
    if not isinstance(content, dict):
        raise ValueError(f"it must be {KINDS[dict]}, not {KINDS[type(content)]}")
    if content.pop("format", None) != FORMAT:
        raise ValueError(f'its format must be "{FORMAT}"')
    _check_version(content.pop("format_version", None))
    _check_kinds("", content, ITS_KINDS)
    _check_kinds("network.", content["network"], NETWORK_KINDS)
    for name, choices in CHOICES.items():
        if content["network"][name] not in choices:
            raise ValueError(
                f"network.{name} must be one of {', '.join(choices)}, not "
                f"{_shown(content['network'][name])}"
            )
    content["network"] = GnnShape(**content["network"])
    content["silence_logit"] = float(content["silence_logit"])
    return PolicyConfig(**content)


def _parsed(text: str | bytes) -> Any:  # noqa: ANN401 - anything in JSON
    try:
        return json.loads(text, parse_constant=_refuse, parse_float=_finite)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"it is no JSON ({error})") from error


def _refuse(number: str) -> float:
    raise ValueError(f"{number} is no finite number")


def _finite(number: str) -> float:
    return float(number) if math.isfinite(float(number)) else _refuse(number)


def _check_version(version: Any) -> None:  # noqa: ANN401 - anything in JSON
    """Raises ValueError unless this code can read the format's version."""
    if type(version) is not int or version < 1:
        raise ValueError(f"its format_version must be a whole number from 1, not {_shown(version)}")
    if version > FORMAT_VERSION:
        raise ValueError(
            f"its format_version is {version}, and this swarm_mj reads {FORMAT_VERSION}; update it"
        )


def _check_kinds(
    prefix: str, content: dict[str, Any], kinds: Mapping[str, tuple[Any, ...]]
) -> None:
    """Raises ValueError unless there are these keys and no others, each of one of its kinds."""
    for key in content:
        if key not in kinds:
            raise ValueError(f"it has an unknown key, {prefix}{key:.40}")
    for key, allowed in kinds.items():
        if key not in content:
            raise ValueError(f"it lacks the key {prefix}{key}")
        if type(content[key]) not in allowed:  # in JSON, true is no number
            described = " or ".join(KINDS[kind] for kind in allowed)
            raise ValueError(f"{prefix}{key} must be {described}, not {_shown(content[key])}")


def _shown(value: Any) -> str:  # noqa: ANN401 - anything in JSON
    """A value as it stands in the file, or its beginning."""
    return f"{json.dumps(value):.40}"
