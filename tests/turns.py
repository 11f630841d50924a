"""Turns of a window that are settled beforehand."""


def settled(states, recipient):
    """A policy that decides so, and robots that move there: two arguments of a window."""
    return lambda _: recipient, lambda: states
