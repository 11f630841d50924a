"""Robot swarms on MuJoCo that share their state over a radio they compete for.

Source: Tolstaya, Butler, Mox, Paulos, Kumar, Ribeiro: Learning Connectivity for Data Distribution
in Robot Teams. Where its text and its authors' code differ, see `mission.paper` and
`mission.reference`. The map from the paper to the code:

    II-A    Eq. 1   path loss                radio.free_space.path_loss_db
    II-A    Eq. 2   channel gain             radio.free_space.channel_gain
    II-A    Eq. 3   SINR                     radio.reception.sinr
    II-A    Eq. 4   reception                radio.reception.is_received
    II-B    Eq. 5   self-observation         protocol.buffers.write_own
    II-B    Eq. 6   channel f                radio.free_space.Channel
    II-B    Eq. 7   last attempt             protocol.buffers.write_attempt
    II-B    Eq. 8   merge                    protocol.buffers.merge_newer
    II-B    Fig. 1  a robot's buffer         protocol.buffers.Buffers
    II-C    Eq. 9   local policy             policies.policy.DecentralisedPolicy
    II-C    Eq. 10  age of information       protocol.costs.age_of_information
    III-B   Alg. 1  the protocol's window    protocol.window.window
    IV-C            two broadcasts instead   protocol.window_protocols.DoubleBroadcast
    III-A           a buffer as a graph      policies.gnn.graphs.Graphs
    III-A   Eq. 11  GN block                 policies.gnn.network.gn_block
    III-A   Eq. 12  mean aggregation         policies.gnn.network.mean_aggregation
    III-A   Eq. 13  non-linear updates       policies.gnn.network.Core
    III-A   Eq. 14  Aggregation GNN          policies.gnn.network.AggregationGnn
    III-C           decisions                policies.gnn.decisions.recipient_logits
    III-C           PPO                      learning.ppo.make_model
    III-C           the training loop        learning.train.TrainingSession.learn
    IV-A    Eq. 15  dynamics                 physics.worlds.PointWorlds.step
    IV-A    Eq. 16  flocking control         control.motion.flocking
    IV-A    Eq. 17  velocity variance        protocol.costs.velocity_variance
    IV-A    Fig. 2  a flock that agrees      evaluation.figures.flock.draw_flock
    IV-B            mission specification    mission.specification.Mission
    IV-B            initial positions        mission.placement.connected_positions
    IV-C            random flooding          policies.random_access.RandomFlooding
    IV-C            round robin              policies.centralised.RoundRobin
    IV-C            minimum spanning tree    policies.centralised.MinimumSpanningTree
    V       Fig. 3  receptive field          evaluation.published.RECEPTIVE_FIELD
    V       Fig. 4  transmit power           evaluation.published.TRANSMIT_POWER
    V       Fig. 5  team size                evaluation.published.TEAM_SIZE
    V       Fig. 6  velocity of a flock      evaluation.published.FLOCKING

Around the paper: `system` (compiling, declared fields, files that appear whole, processes),
`simulation` (B missions side by side; a policy from the first window to the last), more `policies`
than the paper's, `evaluation` (V: policies on the same missions, and Figs. 2 to 6), `replay` (what
is seen), `envs` (interfaces of other libraries), `api` (Python in five lines; its names stand here
as well), `cli` (the command line).
"""

from importlib import import_module

from swarm_mj.system.after_import import after_import
from swarm_mj.system.lazy_names import attach_stub

# The public names are those of `__init__.pyi`, and nowhere else. Type checkers and editors read
# them there, and so does this; each module is imported when a name of it is first asked for.
_public_name, __dir__, __all__ = attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    """Return a public name, or the version, when it is first asked for."""
    if name == "__version__":
        return import_module("swarm_mj.system.packages").version()
    return _public_name(name)


def _register_environments() -> None:
    import_module("swarm_mj.envs").register_environments()


# `gymnasium.make` then knows the environments, whichever of the two is imported first; who does
# without Gymnasium does not wait for it.
after_import("gymnasium", _register_environments)
