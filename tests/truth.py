"""Perfect communication, which no channel gives: the test plays it."""


def tell_everyone_the_truth(swarm):
    """Every buffer holds every robot's state of now."""
    swarm.buffers.timestamp[...] = 0.5 + swarm.now[:, None, None]
    swarm.buffers.position_m[...] = swarm.states.position_m[:, None]
    swarm.buffers.velocity_mps[...] = swarm.states.velocity_mps[:, None]
