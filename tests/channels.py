"""Channels without physics, and perfect communication, for tests of what is above the radio."""

import numpy as np


def tell_everyone_the_truth(swarm):
    """Perfect communication, which no channel gives: every buffer holds everyone's state of now."""
    swarm.buffers.timestamp[...] = 0.5 + swarm.now[:, None, None]
    swarm.buffers.position_m[...] = swarm.states.position_m[:, None]
    swarm.buffers.velocity_mps[...] = swarm.states.velocity_mps[:, None]


def to_nobody(_position_m, recipient):
    """Every packet is lost."""
    return np.tile(np.arange(recipient.shape[1]), (len(recipient), 1))


def to_the_addressee(position_m, recipient):
    """Every packet reaches its recipient, and nobody else."""
    heard = to_nobody(position_m, recipient)
    for b, row in enumerate(recipient):
        for i, j in enumerate(row):
            if j != i:
                heard[b, j] = i
    return heard


class Lossy:
    """Half of the packets reach their recipient; every mission draws for itself."""

    def start(self, _num_robots, rngs):
        self.rngs = rngs

    def __call__(self, position_m, recipient):
        heard = to_the_addressee(position_m, recipient)
        draws = np.stack([rng.random(recipient.shape[1]) for rng in self.rngs])
        return np.where(draws < 0.5, to_nobody(position_m, recipient), heard)


def to_everyone(_position_m, recipient):
    """All others decode the one sender, and nobody if there are several or none."""
    heard = to_nobody(_position_m, recipient)
    for b, row in enumerate(recipient):
        senders = [i for i, j in enumerate(row) if j != i]
        if len(senders) == 1:
            heard[b] = senders[0]
    return heard


def unreliable(seed, *, senders_listen):
    """Everyone decodes some sender or nobody, never the same way twice."""
    rng = np.random.default_rng(seed)

    def channel(position_m, recipient):
        heard = to_nobody(position_m, recipient)
        for b, row in enumerate(recipient):
            for j in range(len(row)):
                senders = [i for i in range(len(row)) if row[i] != i and i != j]
                to_me = [i for i in senders if row[i] == j]
                chance = rng.random()
                if senders and chance < 0.7 and (senders_listen or row[j] == j):
                    heard[b, j] = rng.choice(to_me if to_me and chance < 0.5 else senders)
        return heard

    return channel
