"""The arithmetic of one packet at one receiver, by hand and by the normal distribution."""

import numpy as np
import pytest
from scipy.stats import norm

from swarm_mj.radio.reception import (
    Incoming,
    add_packet,
    add_to_air,
    decode_probability,
    decoded,
    incoming_at,
    is_received,
    received_power,
    silent_air,
    sinr,
)


def test_eq2_power_falls_with_the_square_of_the_distance_down_to_a_millimetre():
    assert received_power(8.0, 16.0) == 0.5
    assert received_power(8.0, 0.0) == received_power(8.0, 1e-7) == pytest.approx(8e6)


def test_eq3_sinr_by_hand():
    assert sinr(6.0, 1.0, 2.0) == 2.0
    assert sinr(6.0, 0.0, 2.0) == 3.0
    assert sinr(6.0, 6.0, 0.0) == 1.0


def test_eq4_the_threshold_itself_is_enough():
    assert is_received(1.25, 1.25)
    assert not is_received(np.nextafter(1.25, 0.0), 1.25)


def incoming(j, *packets):
    """All packets at j: senders, and the powers that j may decode and is disturbed by."""
    result = Incoming(0.0, 0.0, j)
    for i, signal, interference in packets:
        result = add_packet(result, i, signal, interference)
    return result


def test_the_strongest_packet_counts_and_of_equal_ones_the_first():
    assert incoming(7) == (0.0, 0.0, 7)
    assert incoming(7, (1, 2.0, 2.0), (2, 6.0, 6.0), (3, 6.0, 6.0)) == (14.0, 6.0, 2)
    assert incoming(7, (1, 2.0, 2.0), (2, 0.0, 6.0)) == (8.0, 2.0, 1), "jammed, not decodable"


def test_eq4_a_packet_decodes_beside_all_others_by_hand():
    """6 over a noise of 1 and another packet of 2: an SINR of 2."""
    heard = incoming(7, (1, 6.0, 6.0), (2, 2.0, 2.0))
    assert decoded(heard, 7, 1.0, 2.0) == 1
    assert decoded(heard, 7, 1.0, np.nextafter(2.0, 3.0)) == 7
    assert decoded(heard, 7, 1.0, 2.0, factor=1.1) == 7
    assert decoded(heard, 7, 1.0, 1.2, factor=2.0) == 1, "6 / (1 + 2 * 2)"
    assert decoded(incoming(7), 7, 1.0, 0.5) == 7


def test_the_air_holds_all_packets_at_every_receiver():
    air = silent_air(3)
    add_to_air(air, 1, 0, 2.0, 3.0)
    add_to_air(air, 2, 0, 4.0, 5.0)
    assert [incoming_at(air, j) for j in range(3)] == [(8.0, 4.0, 2), (0.0, 0.0, 1), (0.0, 0.0, 2)]


def chance(ratio, distance_over_std):
    """Of a packet at `ratio` times the threshold."""
    return decode_probability(2.0 * ratio, 2.0, distance_over_std)


def test_a_believed_link_decodes_as_the_normal_distribution_says():
    """The reach is d sqrt(ratio) for a distance d known up to d / distance_over_std."""
    for distance_over_std in (0.8, 4.0, 30.0):
        for z in np.linspace(-2.5, 2.5, 81)[1:-1]:
            if z / distance_over_std > -1.0:
                ratio = (1.0 + z / distance_over_std) ** 2
                assert chance(ratio, distance_over_std) == pytest.approx(norm.cdf(z), abs=0.0096)


def test_chance_is_a_half_at_the_range_and_monotone():
    assert chance(1.0, 3.0) == 0.5
    assert np.all(np.diff([chance(ratio, 3.0) for ratio in np.linspace(0.1, 4.0, 99)]) >= 0.0)
    assert chance(1.1, 3.0) < chance(1.2, 3.0)


def test_far_beyond_doubt_a_packet_decodes_for_certain_or_never():
    """At 2.4 deviations it is in doubt, at 2.6 not: the normal law leaves 0.5 % there."""
    assert chance(1.24**2, 10.0) == pytest.approx(0.983, abs=1e-3)
    assert chance(0.76**2, 10.0) == pytest.approx(0.017, abs=1e-3)
    assert chance(1.26**2, 10.0) == 1.0
    assert chance(0.74**2, 10.0) == 0.0
