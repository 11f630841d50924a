"""The buffers (II-B, Eqs. 5, 7, 8): what every robot knows about every other.

Index order: `[b, i, j]` is what robot `i` of mission `b` knows about robot `j`. The functions here
are the only ones that write what a robot knows, and they write it in place.

Each equation is one loop over arrays, `write_own`, `write_attempt` and `merge_newer`, from which
windows of both kinds are made, compiled ones too. `observe_self`, `record_attempt` and `merge` take
the arrays out of `Buffers` for these loops.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.mission.geometry import PLANE
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.timestamps import is_newer
from swarm_mj.system.compiled import compiled

NO_PARENT = -1  # of oneself, and of a teammate never heard of over the radio
BROADCAST = -1  # the recipient of a packet for everyone who hears it
NEVER = 0.0  # T_0 and L_0: the clock's first tick is half a window, so 0 is before everything
ABSENT = -np.inf  # T of an entry that a packet has no room for: older than all that is held


@dataclass(frozen=True, kw_only=True)
class Buffers:
    """The knowledge of every robot i about every robot j, in all B missions (Fig. 1).

    Example:
        How many windows old robot 0's news of robot 3 is, in the first mission:

        >>> swarm.now[0] - swarm.buffers.timestamp[0, 0, 3]
    """

    timestamp: Float[np.ndarray, "B N N"]  # T^{i,j}: when j observed it [windows], or NEVER
    position_m: Float[np.ndarray, "B N N D"]  # M^{i,j}: where j was, as i knows it [m]
    velocity_mps: Float[np.ndarray, "B N N D"]  # M^{i,j}: how fast j was, as i knows it [m/s]
    parent: Int[np.ndarray, "B N N"]  # P^{i,j}: whom j first passed it to, or NO_PARENT
    last_attempt: Float[np.ndarray, "B N N"]  # L^{i,j}: when i last addressed j [windows], or NEVER
    is_granted: Bool[np.ndarray, "B"]  # all states at t = 0 were known: then NEVER means T = 0

    @property
    def is_known(self) -> Bool[np.ndarray, "B N N"]:
        """True where i has observed j, received an entry of it (T > T_0), or knew its start."""
        return (self.timestamp > NEVER) | self.is_granted[:, None, None]

    @property
    def shape(self) -> tuple[int, int]:
        """B missions of N robots."""
        num_missions, num_robots, _ = self.timestamp.shape
        return num_missions, num_robots

    def read_only(self) -> "Buffers":
        """Return the same arrays, seen through views that cannot be written."""
        views = {}
        for spec in fields(Buffers):
            view = getattr(self, spec.name).view()
            view.flags.writeable = False
            views[spec.name] = view
        return Buffers(**views)


def empty_buffers(num_missions: int, num_robots: int, num_axes: int = PLANE) -> Buffers:
    """Return buffers before the first observation: everything unknown."""
    shape = num_missions, num_robots, num_robots
    return Buffers(
        timestamp=np.full(shape, NEVER),
        position_m=np.zeros((*shape, num_axes)),
        velocity_mps=np.zeros((*shape, num_axes)),
        parent=np.full(shape, NO_PARENT, dtype=np.int32),
        last_attempt=np.full(shape, NEVER),
        is_granted=np.zeros(num_missions, dtype=np.bool_),
    )


def grant_start(buffers: Buffers, states: RobotStates) -> None:
    """Write all states at the start, as observed, into empty buffers, without parents."""
    buffers.position_m[:] = states.own_m[:, None]
    buffers.velocity_mps[:] = states.velocity_mps[:, None]
    buffers.is_granted[:] = True


@compiled()
def write_own(
    timestamp: Float[np.ndarray, "B N N"],
    believed_m: Float[np.ndarray, "B N N D"],
    believed_mps: Float[np.ndarray, "B N N D"],
    observed_m: Float[np.ndarray, "B N D"],
    observed_mps: Float[np.ndarray, "B N D"],
    now: Float[np.ndarray, "B"],
    is_active: Bool[np.ndarray, "B N"] | None,
) -> None:
    """Write every active robot's own state and the time t into its own buffer (Eq. 5).

    T^{i,i} = t, and M^{i,i} is what robot i observes of itself at t.

    Args:
        timestamp: T of the robots' buffers, [B N N], [windows]; written, as the next two are.
        believed_m: The positions of M, [B N N D], [m].
        believed_mps: The velocities of M, [B N N D], [m/s].
        observed_m: Where each robot observes itself to be, [B N D], [m].
        observed_mps: How fast it observes itself to be, [B N D], [m/s].
        now: t, [B], [windows].
        is_active: Who observes anything, [B N]; None is everyone.
    """
    num_missions, num_robots = timestamp.shape[:2]
    for b in range(num_missions):
        for i in range(num_robots):
            # None is compiled apart, without the test.
            if is_active is not None and not is_active[b, i]:
                continue
            timestamp[b, i, i] = now[b]
            for axis in range(observed_m.shape[2]):
                believed_m[b, i, i, axis] = observed_m[b, i, axis]
                believed_mps[b, i, i, axis] = observed_mps[b, i, axis]


def observe_self(buffers: Buffers, states: RobotStates, now: Float[np.ndarray, "B"]) -> None:
    """Let every active robot observe itself at t, as `write_own` says; `now` is t [windows]."""
    write_own(
        timestamp=buffers.timestamp,
        believed_m=buffers.position_m,
        believed_mps=buffers.velocity_mps,
        observed_m=states.own_m,
        observed_mps=states.velocity_mps,
        now=now,
        is_active=states.is_active,
    )


@compiled()
def write_attempt(
    last_attempt: Float[np.ndarray, "B N N"],
    recipient: Int[np.ndarray, "B N"],
    now: Float[np.ndarray, "B"],
    silence_is_attempt: bool,
    is_active: Bool[np.ndarray, "B N"] | None,
) -> None:
    """Note when each active robot last addressed its recipient (Eq. 7).

    L^{i,j} = t for the recipient j of robot i, and stays as it was for all others.

    Args:
        last_attempt: L of the robots' buffers, [B N N], [windows]; written.
        recipient: Whom each robot addresses, [B N]; itself is silence. `BROADCAST` addresses no
            robot.
        now: t, [B], [windows].
        silence_is_attempt: Whether a silent robot notes having addressed itself.
        is_active: Who notes anything, [B N]; None is everyone.
    """
    num_missions, num_robots = recipient.shape
    for b in range(num_missions):
        for i in range(num_robots):
            if is_active is not None and not is_active[b, i]:
                continue
            j = recipient[b, i]
            if j != BROADCAST and (silence_is_attempt or j != i):
                last_attempt[b, i, j] = now[b]


def record_attempt(
    buffers: Buffers,
    recipient: Int[np.ndarray, "B N"],
    now: Float[np.ndarray, "B"],
    is_active: Bool[np.ndarray, "B N"] | None = None,
    *,
    silence_is_attempt: bool = False,
) -> None:
    """Note in the buffers whom each active robot addresses, as `write_attempt` says."""
    write_attempt(
        last_attempt=buffers.last_attempt,
        recipient=recipient,
        now=now,
        silence_is_attempt=silence_is_attempt,
        is_active=is_active,
    )


@compiled()
def merge_newer(
    sent_t: Float[np.ndarray, "B N N"],
    sent_m: Float[np.ndarray, "B N N D"],
    sent_mps: Float[np.ndarray, "B N N D"],
    sent_parent: Int[np.ndarray, "B N N"],
    heard: Int[np.ndarray, "B N"],
    timestamp: Float[np.ndarray, "B N N"],
    believed_m: Float[np.ndarray, "B N N D"],
    believed_mps: Float[np.ndarray, "B N N D"],
    parent: Int[np.ndarray, "B N N"],
) -> None:
    """Replace all entries by those strictly newer in the packet each robot decoded (Eq. 8).

    Where robot i decoded j, and T^{i,k} < T^{j,k}, i's T, M and P of k become j's. Information that
    comes straight from its subject gets the receiver as parent (II-B: P^{i,k} = i). An entry keeps
    its parent if the parent's own entry is in the packet, and otherwise names the sender: so
    buffers remain trees, although some robots on the way are left out.

    Args:
        sent_t: T of the entries in each robot's packet, [B N N], [windows], `ABSENT` for those that
            it left out.
        sent_m: The positions of M in these packets, [B N N D], [m].
        sent_mps: The velocities of M in these packets, [B N N D], [m/s].
        sent_parent: P in these packets, [B N N].
        heard: The sender that each robot decoded, [B N]; itself is nobody.
        timestamp: T of the robots' buffers, [B N N], [windows]; written, as all that follow. These
            may be the packets' own arrays unless `senders_listen`.
        believed_m: The positions of M, [B N N D], [m].
        believed_mps: The velocities of M, [B N N D], [m/s].
        parent: P, [B N N].
    """
    num_missions, num_robots = heard.shape
    for b in range(num_missions):
        for i in range(num_robots):
            j = heard[b, i]
            if j == i:
                continue
            for k in range(num_robots):
                if is_newer(sent_t[b, j, k], timestamp[b, i, k]):
                    timestamp[b, i, k] = sent_t[b, j, k]
                    for axis in range(sent_m.shape[3]):
                        believed_m[b, i, k, axis] = sent_m[b, j, k, axis]
                        believed_mps[b, i, k, axis] = sent_mps[b, j, k, axis]
                    named = sent_parent[b, j, k]
                    # No branches: of 32 missions side by side they took twice the time. Of j itself
                    # `named` is NO_PARENT, by which the last robot is read, and nothing is used.
                    kept = j if sent_t[b, j, named] == ABSENT else named
                    parent[b, i, k] = i if k == j else kept


@compiled()
def senders_listen(heard: Int[np.ndarray, "B N"]) -> bool:
    """Return whether anyone's packet is decoded that decodes one itself.

    Packets hold buffers as they were before the slot, so they must be copies then. Only the
    reference preset lets it happen; else no row of a buffer is both read and written.
    """
    for b in range(heard.shape[0]):
        for i in range(heard.shape[1]):
            if heard[b, i] != i and heard[b, heard[b, i]] != heard[b, i]:
                return True
    return False


def merge(
    buffers: Buffers,
    heard: Int[np.ndarray, "B N"],
    sent: Float[np.ndarray, "B N N"] | None = None,
    *,
    written: Buffers | None = None,
) -> None:
    """Merge the packets that robots decoded into their buffers, as `merge_newer` says.

    Args:
        buffers: The robots' buffers, written in place.
        heard: The sender that each robot decoded, [B N]; itself is nobody.
        sent: T of the entries in each robot's packet, [B N N], [windows]; None is the whole buffer.
        written: What packets hold, where that is no longer what their senders know: other arrays of
            T, M and P. None: the senders' buffers as they are.
    """
    packets = buffers if written is None else written
    sent_t = packets.timestamp if sent is None else sent
    if written is None and senders_listen(heard):
        packets = copied(buffers)
        sent_t = sent_t.copy()
    merge_newer(
        sent_t=sent_t,
        sent_m=packets.position_m,
        sent_mps=packets.velocity_mps,
        sent_parent=packets.parent,
        heard=heard,
        timestamp=buffers.timestamp,
        believed_m=buffers.position_m,
        believed_mps=buffers.velocity_mps,
        parent=buffers.parent,
    )


def copied(buffers: Buffers) -> Buffers:
    """Return other arrays of T, M and P; what else there is stays the same arrays."""
    return replace(
        buffers,
        timestamp=buffers.timestamp.copy(),
        position_m=buffers.position_m.copy(),
        velocity_mps=buffers.velocity_mps.copy(),
        parent=buffers.parent.copy(),
    )
