"""The memory and disk that a study takes, asked before it is flown."""

from swarm_mj.evaluation.study import Study
from swarm_mj.simulation.memory import memory_growth, policy_memory
from swarm_mj.system.needs import Needs

# Of each age that is counted and of each mission, in memory and in a file [bytes].
AGE_COUNT = 50.0
AGE_COUNT_IN_FILE = 5.0
RESULT = 1000.0
RESULT_IN_FILE = 300.0


def study_needs(study: Study, num_jobs: int) -> Needs:
    """Return the memory and disk of a study: a batch in each process, and the results of all."""
    batches = study.batches
    memory = [policy_memory(each.policy, each.mission, len(each.seeds)) for each in batches]
    largest = max(memory)
    hungriest = batches[memory.index(largest)]
    ages = sum(2 * batch.mission.num_windows + 1 for batch in batches)  # counts
    under_way = min(num_jobs, len(batches)) * largest
    return Needs(
        memory=under_way + AGE_COUNT * ages + RESULT * study.num_missions,
        file=AGE_COUNT_IN_FILE * ages + RESULT_IN_FILE * study.num_missions,
        grows=memory_growth(hungriest.policy, hungriest.mission),
    )
