"""The public names, each once: see `system.lazy_names`. `X as X` says that X is re-exported."""

from swarm_mj.api.check import check_convergence as check_convergence
from swarm_mj.api.evaluate import Evaluation as Evaluation
from swarm_mj.api.evaluate import evaluate as evaluate
from swarm_mj.api.fly import fly as fly
from swarm_mj.api.run import Run as Run
from swarm_mj.evaluation.convergence import Convergence as Convergence
from swarm_mj.mission import Mission as Mission
from swarm_mj.mission import paper as paper
from swarm_mj.mission import reference as reference
from swarm_mj.physics.state import RobotStates as RobotStates
from swarm_mj.policies import POLICIES as POLICIES
from swarm_mj.policies import BroadcastPolicy as BroadcastPolicy
from swarm_mj.policies import CentralisedPolicy as CentralisedPolicy
from swarm_mj.policies import DecentralisedPolicy as DecentralisedPolicy
from swarm_mj.policies import LocalViews as LocalViews
from swarm_mj.policies import Policy as Policy
from swarm_mj.policies import make_policy as make_policy
from swarm_mj.protocol.buffers import Buffers as Buffers
from swarm_mj.simulation.link import Link as Link
from swarm_mj.simulation.rollout import Summary as Summary
from swarm_mj.simulation.rollout import summarise as summarise
from swarm_mj.simulation.swarm import Swarm as Swarm

__version__: str
