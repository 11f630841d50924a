"""Crashes of quadrotors that avoid each other by news of different ages.

    make results STUDIES=crashes

Forty quadrotors fly errands among trees by `examples/avoiding.py`, in teams of two densities. What
they know of each other comes by the radio, with several policies; or they know all states as they
were a while ago. `crashes_figure.py` draws the table, `training/results/crashes.csv`.
"""

from functools import partial
from itertools import chain

from examples import avoiding

from swarm_mj.evaluation.results import Result
from swarm_mj.evaluation.study import Study
from swarm_mj.mission import paper
from swarm_mj.simulation.components import Components

MODULE = "training.examples.avoiding"
BY_RADIO = "Errands"
DELAYED = [name for name, value in vars(avoiding).items() if isinstance(value, partial)]
POLICIES = (
    *("index-csma", "sotdma", "planner", "tdma"),
    *("random-flooding", "mst", "round-robin", "gnn"),
)
ANY_POLICY = ("tdma",)  # with delays, packets carry nothing that robots use
DENSITIES_PER_KM2 = (1000.0, 3000.0)
MISSIONS = tuple(
    paper(
        "random-walk",
        robot="quadrotor",
        collide=True,
        arena="forest",
        height_m=5.0,
        density_per_km2=density_per_km2,
    )
    for density_per_km2 in DENSITIES_PER_KM2
)


def studies() -> dict[str, Study]:
    """Return the flights with each controller of `avoiding.py`, by its name."""
    found = {}
    for name in chain([BY_RADIO], DELAYED):
        found[name] = Study(
            policies=POLICIES if name == BY_RADIO else ANY_POLICY,
            regimes=MISSIONS,
            episodes=20,
            seed=6400,
            components=Components(controller=f"{MODULE}:{name}"),
        )
    return found


def delay_of(result: Result) -> int | None:
    """Return how old all news was [windows]; None: it came by the radio."""
    name = str(result.controller).partition(":")[2]
    return None if name == BY_RADIO else int(getattr(avoiding, name).args[0])
