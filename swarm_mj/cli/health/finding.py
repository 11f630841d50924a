"""What was found of one thing, and how to mend it."""

from typing import Literal, NamedTuple

State = Literal["ok", "absent", "broken"]


class Finding(NamedTuple):
    """One thing that was looked at."""

    group: str  # the heading it stands under
    name: str
    state: State  # absent: flying does without; broken: nothing flies before it is mended
    found: str
    mend: str = ""  # what to do, if it is not ok
