"""The features of version 1.0.0, whose stored policies do not name their own: frozen.

Files of later versions hold the names that they were trained on. This record is read in place of
these; to change it would be to say that old policies were trained on something else.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

FEATURES_OF_1_0: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "paper": (
            "is oneself",
            "is known",
            "T",
            "p_x",
            "p_y",
            "v_x",
            "v_y",
            "L",
        ),
        "reference": (
            "T - t",
            "zero",
            "p_x relative",
            "p_y relative",
            "v_x relative",
            "v_y relative",
            "L - t",
        ),
        "local": (
            "is oneself",
            "is known",
            "age of T",
            "distance",
            "is in range",
            "age of last packet heard",
            "age of last attempt",
            "age of last being addressed",
            "news to it, by its last packet",
            "news to it, if it heard what was said last",
            "neighbours",
            "share of the team known",
            "size of the team",
        ),
        "extended": (
            "is oneself",
            "is known",
            "age of T",
            "distance",
            "is in range",
            "age of last packet heard",
            "age of last attempt",
            "age of last being addressed",
            "news to it, by its last packet",
            "news to it, if it heard what was said last",
            "rank of its turn",
            "has a turn, 1.5 ranges apart",
            "has a turn, 2 ranges apart",
            "has a turn, 3 ranges apart",
            "has a turn, by interference",
            "neighbours",
            "share of the team known",
            "size of the team",
        ),
    }
)
