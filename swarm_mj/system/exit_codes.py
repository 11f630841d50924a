"""How a command ends, for scripts to read."""

DONE = 0
FAILED = 1  # the machine: memory, a disk, a library that is missing
BAD_INPUT = 2  # what was asked for, as argparse has it, too
REFUTED = 3  # of `check`: what was claimed does not hold
UNDECIDED = 4  # of `check`: the missions flown do not tell
INTERRUPTED = 130  # by Ctrl-C, SIGTERM or a hang-up: 128 + SIGINT, as shells have it
