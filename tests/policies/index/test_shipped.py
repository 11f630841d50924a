"""The numbers that come with the package."""

import re
import tomllib

from swarm_mj.policies.index.shipped import SHIPPED, shipped_weights
from swarm_mj.policies.index.weights import flat, from_flat


def test_the_shipped_numbers_say_how_they_were_made_and_are_what_they_may_be():
    made = tomllib.loads(SHIPPED.read_text())["made"]
    assert made.keys() == {"command", "seed", "decisions", "minutes", "commit"}
    assert re.fullmatch(r"python training/shipped_index.py --minutes [\d.]+", made["command"])
    weights = shipped_weights()
    assert flat(from_flat(flat(weights))).tolist() == flat(weights).tolist()
