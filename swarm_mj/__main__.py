"""`python -m swarm_mj` is `swarm-mj`."""

from swarm_mj.cli import end_process

end_process()
