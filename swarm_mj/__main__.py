"""`python -m swarm_mj` is `swarm-mj`."""

import sys

from swarm_mj.cli import main

sys.exit(main())
