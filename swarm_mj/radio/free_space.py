"""The radio (II-A, Eqs. 1-4): who decodes whom, from positions and concurrent transmissions.

Index order everywhere: `i` sends, `j` receives. Powers and ratios are linear unless their name
ends in `_db` or `_dbm`. As a robot that addresses itself is silent (Alg. 1), so a robot that hears
itself heard nobody: no sentinel is needed.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.mission.geometry import squared_distance
from swarm_mj.radio.reception import (
    Incoming,
    add_packet,
    decoded,
    may_decode,
    received_power,
)
from swarm_mj.system.compiled import compiled
from swarm_mj.system.decibels import from_db


@runtime_checkable
class Channel(Protocol):
    """f: who decodes whom; the protocol takes any of these, a plain function too (Eq. 6).

    Example:
        >>> import numpy as np
        >>> def everyone_hears_robot_0(position_m, recipient):
        ...     heard = np.tile(np.arange(recipient.shape[1]), (len(recipient), 1))
        ...     return np.where(recipient[:, :1] != 0, 0, heard)
    """

    def __call__(
        self, position_m: Float[np.ndarray, "B N D"], recipient: Int[np.ndarray, "B N"]
    ) -> Int[np.ndarray, "B N"]:
        """Return the sender that each robot decodes.

        Args:
            position_m: Where each robot is [m], [B N D]: missions, robots, axes.
            recipient: Whom each robot addresses, [B N]; -1 is everyone, and itself is silence.

        Returns:
            The sender that each robot decodes, [B N]; itself is nobody. A robot that transmits may
            decode another's packet; nobody decodes a robot that is silent.
        """
        ...


@runtime_checkable
class VaryingChannel(Protocol):
    """A channel that is another one in every slot, and the same again when a slot is replayed."""

    def at(self, slot: Int[np.ndarray, "B"], mission: Int[np.ndarray, "B"], /) -> Channel:
        """Return the channel of one slot in each row; a window has two slots.

        Args:
            slot: Of each row, counted from the mission's start, [B].
            mission: Of each row, counted from 0, [B].

        Returns:
            What decodes in these slots; it is called once.
        """
        ...


OwnChannel = Channel | VaryingChannel | str  # in place of the mission's; a text is its name


def path_loss_db(distance_m: float, frequency_hz: float) -> float:
    """Return the free-space path loss over a distance [dB] (Eq. 1)."""
    # The paper rounds 20 log10(c / 4 pi), 147.5522: all that sets our powers apart from ns-3's.
    return 20.0 * math.log10(distance_m) + 20.0 * math.log10(frequency_hz) - 147.55


def channel_gain(loss_db: float) -> float:
    """Return the received over the transmitted power, linear [1] (Eq. 2)."""
    return from_db(-loss_db)


def transmit_power_dbm(
    range_m: float, frequency_hz: float, noise_dbm: float, threshold_db: float
) -> float:
    """Return the power whose packets decode exactly up to a range in silence [dBm] (IV-B)."""
    return noise_dbm + threshold_db + path_loss_db(range_m, frequency_hz)


@dataclass(frozen=True, kw_only=True)
class FreeSpaceRadio:
    """The paper's channel: free-space path loss, interference of all concurrent transmitters.

    A robot's own signal is interference to it, so a transmitter hears nothing. The authors' code
    exempts the addressed recipient: `recipient_hears_while_sending`. Of several packets above
    the threshold, possible only below 0 dB, a robot decodes the strongest (III-B).

    Args:
        power_mw: Transmit power of every robot, rho [mW].
        noise_mw: Noise power, sigma [mW].
        threshold: Least SINR that decodes, linear [1].
        frequency_hz: Centre frequency, nu [Hz].
        recipient_hears_while_sending: Whether the robot that is addressed decodes while it sends.

    Example:
        >>> import numpy as np
        >>> radio = FreeSpaceRadio(power_mw=8e3, noise_mw=1e-5, threshold=1.26, frequency_hz=2.4e9)
        >>> position_m = np.array([[[0.0, 0.0], [100.0, 0.0], [900.0, 0.0]]])
        >>> radio(position_m, np.array([[-1, 1, 2]])).tolist()  # robot 0 broadcasts
        [[0, 0, 2]]
    """

    power_mw: float  # rho: transmit power of every robot [mW]
    noise_mw: float  # sigma [mW]
    threshold: float  # least SINR that decodes, linear [1]
    frequency_hz: float  # nu [Hz]
    recipient_hears_while_sending: bool = False

    @cached_property
    def received_at_1_m_mw(self) -> float:
        """Power received over one metre [mW]; free space scales it by 1/d² (Eqs. 1-2)."""
        return self.power_mw * channel_gain(path_loss_db(1.0, self.frequency_hz))

    def __call__(
        self, position_m: Float[np.ndarray, "B N D"], recipient: Int[np.ndarray, "B N"]
    ) -> Int[np.ndarray, "B N"]:
        """Return the sender that each robot decodes (Eqs. 1-4); arguments as in `Channel`."""
        return decode_strongest(
            position_m=position_m,
            recipient=recipient,
            received_at_1_m_mw=self.received_at_1_m_mw,
            noise_mw=self.noise_mw,
            threshold=self.threshold,
            hears_while_sending=self.recipient_hears_while_sending,
        )


@compiled()
def decode_strongest(
    position_m: Float[np.ndarray, "B N D"],
    recipient: Int[np.ndarray, "B N"],
    received_at_1_m_mw: float,
    noise_mw: float,
    threshold: float,
    hears_while_sending: bool,
) -> Int[np.ndarray, "B N"]:
    """Return the sender of the strongest packet at each receiver, if it clears the threshold.

    By receiver, in scalars: for large teams that is several times as fast as adding up arrays.
    """
    num_missions, num_robots = recipient.shape
    heard = np.empty_like(recipient)
    sender = np.empty(num_robots, dtype=np.int64)
    for b in range(num_missions):
        num_senders = 0
        for i in range(num_robots):
            if recipient[b, i] != i:
                sender[num_senders] = i
                num_senders += 1
        for j in range(num_robots):
            is_silent = recipient[b, j] == j
            if not (is_silent or hears_while_sending):
                heard[b, j] = j
                continue
            incoming = Incoming(0.0, 0.0, j)
            for s in range(num_senders):
                i = sender[s]
                if i != j:
                    apart_m2 = squared_distance(position_m[b], i, j)
                    power_mw = received_power(received_at_1_m_mw, apart_m2)
                    is_open = may_decode(is_silent, recipient[b, i], j, hears_while_sending)
                    signal_mw = power_mw if is_open else 0.0
                    incoming = add_packet(incoming, i, signal_mw, power_mw)
            heard[b, j] = decoded(incoming, j, noise_mw, threshold)
    return heard
