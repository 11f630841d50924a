import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies import POLICIES, make_policy
from swarm_mj.swarm import Swarm


@pytest.mark.parametrize("name", list(POLICIES))
@pytest.mark.parametrize("physics", ["exact", "contact"])
@pytest.mark.parametrize("task", ["stationary", "random-walk", "flocking"])
def test_smoke(name, physics, task):
    m = paper(task, physics=physics, num_windows=10, boundary="reflect")
    s = Swarm(m, [1, 2])
    p = make_policy(name, m)
    s.start(p)
    for _ in range(10):
        c = s.step(p)
    assert np.isfinite(c.age_windows).all()
