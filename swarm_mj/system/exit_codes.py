"""How a command ends: done, the machine failed, bad input, interrupted."""

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
