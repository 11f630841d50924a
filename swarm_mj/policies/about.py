"""A policy's description of itself, declared once, on its class.

Lists, tables, figures, the check of memory and `make_policy` read it there. A policy of yours may
declare an `About`; a policy of the package declares a `Listed`, from which `POLICIES` is made.
"""

import re
from dataclasses import dataclass
from enum import Enum
from typing import Literal, NamedTuple

from swarm_mj.mission import Mission

NO_PAYLOAD = "none"  # the payload of packets that hold T, M and P alone, in a word
COLOUR = re.compile(r"#[0-9a-f]{6}")
Marker = Literal[
    "o", "s", "^", "v", ">", "<", "8", "P", "p", "D", "d", "h", "H", "X", "*", ".", "_", "|", "x"
]  # of matplotlib's, the ones that figures here use or may use


class Kind(NamedTuple):
    """A kind of information: what tables call it, and a sentence on what it is."""

    label: str
    sentence: str


class Information(Enum):
    """The kinds of information beyond the paper's.

    The paper grants each robot its own buffer of T, M, P and L, and to the baselines of IV-C what
    they are defined by. Tables have these in the order below.
    """

    COMMON_ORDER = Kind(
        label="common order",
        sentence="Identities, or a random order of the robots, which all robots know.",
    )
    CLOCK = Kind(
        label="clock",
        sentence="All robots count slots from the same start, and decide by the number of a slot.",
    )
    TEAM_SIZE = Kind(
        label="team size",
        sentence="The number N of robots.",
    )
    OBSERVED_POSITIONS = Kind(
        label="positions as observed",
        sentence=(
            "Positions in M, its own and its teammates': exact as in the paper, or with the errors "
            "of `--position-noise-m`."
        ),
    )
    TRUE_POSITIONS = Kind(
        label="true positions",
        sentence="All positions at this moment, without errors.",
    )
    RADIO_CONSTANTS = Kind(
        label="radio constants",
        sentence="The radio's range, noise and least SINR; to `gnn` V_max, the bound of speeds.",
    )
    COMMON_RANDOM_NUMBERS = Kind(
        label="common random numbers",
        sentence="Random numbers of the whole team, which every robot draws alike.",
    )
    ACKNOWLEDGEMENTS = Kind(
        label="acknowledgements by T",
        sentence="T in a packet shows whether its sender decoded the robot's own last packet.",
    )
    CARRIER_SENSING = Kind(
        label="carrier sensing",
        sentence="The power in the channel just before the robot would transmit.",
    )
    DECODED_PACKETS = Kind(
        label="decoded packets",
        sentence="Whose packet the robot decoded in which slot; T, M and P say only part of it.",
    )
    AREA = Kind(
        label="area",
        sentence="The area, and so the density of robots.",
    )
    PRIOR_KNOWLEDGE = Kind(
        label="prior knowledge",
        sentence=(
            "What `--prior-knowledge` grants of the channel: the map and statistics; to `planner` "
            "also whether the team rests."
        ),
    )
    POSITION_ERRORS = Kind(
        label="errors of positions",
        sentence="The standard deviation of the errors of positions.",
    )
    ALL_BUFFERS = Kind(
        label="all buffers",
        sentence="The buffers of all robots at this moment.",
    )
    TRUE_CHANNEL = Kind(
        label="true channel",
        sentence="The mean powers and the statistics of the channel that packets take.",
    )

    @property
    def label(self) -> str:
        """The words that tables have for it."""
        return self.value.label

    @property
    def sentence(self) -> str:
        """A sentence on what it is."""
        return self.value.sentence


@dataclass(frozen=True, kw_only=True)
class Payload:
    """The load of packets beyond T, M and P (II-B); `Policy.payload_fields` says how wide it is."""

    name: str  # in a word, as results have it
    meaning: str  # what it holds and what robots do with it, in a line without a full stop


@dataclass(frozen=True, kw_only=True)
class Look:
    """How a method looks in every figure; raises ValueError for what is no colour.

    Args:
        label: Its name in legends.
        colour: As `#` and six digits from 0 to 9 or a to f; tests hold ours apart for colour-blind
            readers.
        marker: As matplotlib names it; no two of our policies but `sotdma` share one.
        marker_size: In points.
        line_width: In points.
    """

    label: str
    colour: str
    marker: Marker
    marker_size: float = 4.5
    line_width: float = 1.4

    def __post_init__(self) -> None:
        if not COLOUR.fullmatch(self.colour):
            raise ValueError(
                f"colour of {self.label} must be # and six digits from 0 to 9 or a to f, not "
                f"{self.colour!r}"
            )


@dataclass(frozen=True, kw_only=True)
class PairMemory:
    """The memory that a policy takes itself for each pair of robots of a mission.

    Args:
        bytes_per_pair: From some moment of the mission on.
        from_round: That moment, in rounds of N windows; shorter missions never take it.
        moving_bytes_per_robot: More, for each robot and pair, where teams move.
    """

    bytes_per_pair: float
    from_round: float = 0.0
    moving_bytes_per_robot: float = 0.0

    def of(self, mission: Mission) -> float:
        """Return what the policy takes for each pair of robots in a mission [bytes]."""
        if mission.num_windows <= self.from_round * mission.num_robots:
            return 0.0
        if not mission.moves:
            return self.bytes_per_pair
        return self.bytes_per_pair + self.moving_bytes_per_robot * mission.num_robots


FEW_BYTES = PairMemory(bytes_per_pair=0.0)  # so few that the mission's own tables hide them


@dataclass(frozen=True, kw_only=True)
class About:
    """A policy's description of itself, its class's attribute `about`; nothing may be left out.

    It holds for the class that declares it, not for subclasses, which may decide by other things.
    The first line of the class's docstring is its summary in lists.

    Args:
        uses: The information that each robot decides by, or the centre, in a few words.
        beyond: The kinds of information of these that the paper does not grant, in some mission.
        payload: What packets carry beyond T, M and P; None if that is nothing.
        look: How it looks in figures.
        memory: What it takes itself for each pair of robots, `FEW_BYTES` for most.

    Example:
        >>> about = About(
        ...     uses="the clock, and how many teammates are in its buffer",
        ...     beyond=(Information.CLOCK,),
        ...     payload=None,
        ...     look=Look(label="mine", colour="#117733", marker="s"),
        ...     memory=FEW_BYTES,
        ... )
    """

    uses: str
    beyond: tuple[Information, ...]
    payload: Payload | None
    look: Look
    memory: PairMemory

    @property
    def payload_name(self) -> str:
        """The payload in a word, `NO_PAYLOAD` if there is none."""
        return NO_PAYLOAD if self.payload is None else self.payload.name


@dataclass(frozen=True, kw_only=True)
class FromPaper:
    """A policy of the paper."""

    section: str


@dataclass(frozen=True, kw_only=True)
class Textbook:
    """A baseline that a textbook, a standard or a well-known article describes."""

    source: str  # author and year


@dataclass(frozen=True, kw_only=True)
class Leading:
    """Our own: its age is lower by a tenth than those of policies with equal information.

    It is so in at least two tasks, in the tables of 40 robots at the paper's range and speed in
    `training/results`; a test holds it to that.
    """

    over: tuple[str, ...]  # the best of the policies with equal information, by their names


@dataclass(frozen=True, kw_only=True)
class VariantOf:
    """Another policy with an option of the command line, under a name of its own."""

    policy: str


@dataclass(frozen=True, kw_only=True)
class Bound:
    """A policy that no team could fly, which shows how low the age can go."""


Origin = FromPaper | Textbook | Leading | VariantOf | Bound


@dataclass(frozen=True, kw_only=True)
class Listed(About):
    """The description of a policy of the package: also its name, and why it is there.

    Args:
        name: On the command line and in results.
        origin: Why it is in the package, which holds no others.
        rank: Its place in lists, in steps of ten; no two are alike.
    """

    name: str
    origin: Origin
    rank: int
