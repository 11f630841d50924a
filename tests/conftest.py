"""What every test runs under."""

from hypothesis import settings

# Compiling takes its time on an example's first run; no law here is about time.
settings.register_profile("swarm_mj", deadline=None, max_examples=50)
settings.load_profile("swarm_mj")
