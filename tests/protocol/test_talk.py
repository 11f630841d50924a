"""The choice of the implementation that plays a swarm's windows, and when it is made."""

from dataclasses import replace

import numpy as np
import pytest
from channels import to_everyone

from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.policies.tdma import Tdma
from swarm_mj.protocol import asynchronous_window, compiled_window, window
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.packets import PacketField, packet_of
from swarm_mj.protocol.partial_buffers import with_room
from swarm_mj.protocol.talk import talk_over
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.mission_radio import mission_radio, radio_of
from swarm_mj.simulation.swarm import Swarm

SIZE = {"num_robots": 6, "num_windows": 4}
PAPER = paper("random-walk", **SIZE)


class OtherRadio(FreeSpaceRadio):
    """A radio of another type, as a user's is: it may decode otherwise."""


def other_radio():
    return OtherRadio(power_mw=1.0, noise_mw=1e-9, threshold=10.0, frequency_hz=2.4e9)


def module_of(talk):
    """The module that plays both forms of a window."""
    modules = {talk.window.func.__module__, talk.broadcast.func.__module__}
    assert talk.window.func.__name__ == "window"
    assert talk.broadcast.func.__name__ == "broadcast"
    assert len(modules) == 1
    return modules.pop()


@pytest.mark.parametrize(
    ("channel", "expected"),
    [
        (radio_of(PAPER), compiled_window),
        (other_radio(), window),
        (to_everyone, window),
        (mission_radio(paper("random-walk", fading="rayleigh", **SIZE)).channel, window),
        (
            mission_radio(paper("random-walk", clock_offset_s=0.02, **SIZE)).channel,
            asynchronous_window,
        ),
    ],
)
def test_the_channel_says_which_window_is_played(channel, expected):
    assert module_of(talk_over(channel, empty_buffers(1, 6))) == expected.__name__


def test_packets_with_room_for_some_entries_only_are_not_compiled():
    radio, buffers = radio_of(PAPER), empty_buffers(1, 6)
    assert module_of(talk_over(radio, with_room(buffers, 5))) == window.__name__
    assert module_of(talk_over(radio, with_room(buffers, 6))) == compiled_window.__name__


class Chatty(Tdma):
    """Turns, with a byte beyond T, M and P."""

    def payload_fields(self, mission):  # noqa: ARG002
        return (PacketField(name="a word", bits=8),)


def test_a_policy_whose_packets_do_not_fit_whole_changes_how_a_swarm_talks():
    """A slot holds a bare buffer of 6 robots to the byte, so one more makes an entry too many."""
    least = 8 * packet_of(PAPER).num_bytes / (PAPER.window_s * SLOT_WINDOWS)
    mission = replace(PAPER, bit_rate=least)
    swarm = Swarm(mission, [1])
    assert module_of(swarm.talk) == compiled_window.__name__
    swarm.start(Chatty())
    assert module_of(swarm.talk) == window.__name__
    swarm.restart([1])
    assert module_of(swarm.talk) == compiled_window.__name__


def test_one_choice_serves_all_windows_until_a_swarm_starts_again(monkeypatch):
    swarm = Swarm(PAPER, [1])
    swarm.start(make_policy("tdma", PAPER))
    chosen = swarm.talk
    monkeypatch.setattr("swarm_mj.simulation.swarm.talk_over", None)  # cannot be asked again
    for _ in range(3):
        swarm.step()
        assert swarm.talk is chosen
    swarm.step_with_recipients(np.array([[1, 1, 2, 3, 4, 5]]))
    assert swarm.talk is chosen
