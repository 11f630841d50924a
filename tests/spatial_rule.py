"""The rule of spatial reuse, with the true radio as judge."""

import numpy as np

from swarm_mj.radio.free_space import FreeSpaceRadio


def agreed_senders(order, turn, position_m, channel):
    """Who sends by the rule: the owner of the turn, and who joins it."""
    num_robots = len(position_m)
    silence = np.arange(num_robots)

    def heard_with(chosen):
        recipient = np.where(np.isin(silence, chosen), (silence + 1) % num_robots, silence)
        return channel(position_m[None], recipient[None])[0]

    chosen = [order[turn % num_robots]]
    heard = heard_with(chosen)
    for place in range(num_robots):
        k = order[(turn + num_robots // 2 + place) % num_robots]
        if k not in chosen and heard[k] == k:
            with_k = heard_with([*chosen, k])
            is_kept = np.all(with_k[heard != silence] == heard[heard != silence])
            if is_kept and np.any(with_k != heard):
                chosen, heard = [*chosen, k], with_k
    return set(chosen)


def radio(range_m, threshold):
    """Noise 1 mW, and a range exactly as given."""
    at_1_m = FreeSpaceRadio(power_mw=1.0, noise_mw=1.0, threshold=threshold, frequency_hz=2.4e9)
    return FreeSpaceRadio(
        power_mw=threshold * range_m**2 / at_1_m.received_at_1_m_mw,
        noise_mw=1.0,
        threshold=threshold,
        frequency_hz=2.4e9,
    )
