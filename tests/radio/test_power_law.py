"""Mean powers by their laws, against hand arithmetic and the channel's own."""

import numpy as np
import pytest

from swarm_mj.physics.state import BOX, Obstacles
from swarm_mj.radio.link_gains import LinkGains
from swarm_mj.radio.path_loss import log_distance
from swarm_mj.radio.power_law import power_law, powers_between

PLACES_M = np.array([[-30.0, 0.0], [-40.0, 0.0], [30.0, 40.0]])


def wall(power_left):
    """Between x < 0 and x > 0."""
    return Obstacles(
        kind=np.array([BOX]),
        centre_m=np.zeros((1, 3)),
        rotation=np.eye(3)[None],
        size_m=np.array([[1.0, 1e4, 1e4]]),
        reach_m=np.array([2e4]),
        power_left=np.array([power_left]),
    )


def test_free_space_is_the_inverse_square_by_hand():
    """10 m, sqrt(60² + 40²) m and sqrt(70² + 40²) m apart; robot 2 sends four times the power."""
    power = powers_between(PLACES_M, power_law(np.array([1.0, 1.0, 4.0])))
    expected = [[0.0, 1 / 100, 1 / 5200], [1 / 100, 0.0, 1 / 6500], [4 / 5200, 4 / 6500, 0.0]]
    np.testing.assert_allclose(power, expected, rtol=1e-12)


def test_a_steeper_law_and_a_wall_by_hand():
    """Beyond 20 m the fourth power: 1/20² (20/d)⁴; a tenth is left behind the wall."""
    law = power_law(np.ones(3), log_distance(4.0, 20.0), wall(0.1))
    power = powers_between(PLACES_M, law)
    assert power[0, 1] == pytest.approx(1 / 100)
    assert power[0, 2] == pytest.approx(0.1 * 20.0**2 / 5200.0**2)
    assert power[2, 1] == pytest.approx(0.1 * 20.0**2 / 6500.0**2)


def test_the_law_is_that_of_the_channel():
    """Of one without shadowing, where robots stand anywhere."""
    rng = np.random.default_rng(1)
    position_m = rng.uniform(-300.0, 300.0, (12, 2))
    sent, path_loss, obstacles = rng.uniform(1.0, 4.0, 12), log_distance(2.7, 30.0), wall(0.25)
    gains = LinkGains(power_law(sent, path_loss, obstacles), None)
    gains.start([rng])
    everyone = np.ones((1, 12), dtype=bool)
    expected = gains.received_mw(position_m[None], np.array([0]), everyone)[0]
    power = powers_between(position_m, power_law(sent, path_loss, obstacles))
    np.testing.assert_allclose(power, expected, rtol=1e-12)
