"""Numbers that a robot's MJCF file declares, each as `<numeric name="..." data="..."/>`.

They are of its radio and of its motors. A site named `antenna` says where its antenna is.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Float

from swarm_mj.system.arguments import did_you_mean
from swarm_mj.system.fields import check, setting


@dataclass(frozen=True, kw_only=True)
class Declarations:
    """The numbers of a robot's model; a model that declares none has the defaults.

    Raises ValueError for a number out of its range, or one that counts only with another.
    """

    antenna_gain_dbi: float = setting(
        0.0,
        "gain of its antenna, in all directions alike",
        unit="dBi",
        low=-30.0,
        high=40.0,
    )
    power_class_db: float = setting(
        0.0,
        "its transmit power over the mission's",
        unit="dB",
        low=-60.0,
        high=60.0,
    )
    efficiency: float | None = setting(
        None,
        "power of its motors' work over what they take; none: its energy is not known",
        low=0.01,
        high=1.0,
    )
    rotor_radius_m: float | None = setting(
        None,
        "radius of each rotor; none: its motors drive it by no rotors",
        unit="m",
        low=0.005,
        high=20.0,
    )
    idle_power_w: float = setting(
        0.0,
        "power that it takes at all times",
        unit="W",
        low=0.0,
        high=100_000.0,
    )

    def __post_init__(self) -> None:
        check(self)
        if self.efficiency is None and (self.rotor_radius_m is not None or self.idle_power_w > 0.0):
            raise ValueError(
                "rotor_radius_m and idle_power_w count only with efficiency; give that, too"
            )


def declared_by(numerics: Mapping[str, Float[np.ndarray, "_"]]) -> Declarations:
    """Return what a robot's model declares.

    Args:
        numerics: The data of each of its numerics, by name.

    Raises:
        ValueError: A numeric is none of these, is not one number, or is out of its range.
    """
    known = [spec.name for spec in fields(Declarations)]
    given: dict[str, float] = {}
    for name, data in numerics.items():
        if name not in known:
            raise ValueError(
                f"numeric {name} is none of {', '.join(known)}{did_you_mean(name, known)}; "
                "take it out of the file"
            )
        if len(data) != 1:
            raise ValueError(f"numeric {name} must be one number, not {len(data)}; give one")
        given[name] = float(data[0])
    return Declarations(**given)
