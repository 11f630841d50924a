"""The authors' trained policy, in our network and our simulation: does it cost what they published?

    python tools/reference_policy.py stationary_40_receptive_field_5.npz

Their weights (NumPy arrays by TensorFlow name) become a policy, which flies under the
`reference` preset; its mean age of information is compared with theirs in standard errors.
"""

import io
import math
import sys
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import torch

from swarm_mj.cli import script
from swarm_mj.evaluation.batch import fly_batch
from swarm_mj.evaluation.engines import Local
from swarm_mj.evaluation.study import Study
from swarm_mj.mission import reference
from swarm_mj.policies.gnn.network import AggregationGnn
from swarm_mj.policies.policy_config import GnnConfig, GnnShape
from swarm_mj.policies.stored import save_gnn
from swarm_mj.system.fields import setting
from swarm_mj.system.packages import version
from swarm_mj.system.reading import read_file
from swarm_mj.system.terminal import tell_cores

TOO_FAR = 1
MOST_BYTES = 10_000_000  # of the weights
THEIR_AOI, THEIR_SEM = 37.5, 1.0  # over 100 episodes of their simulator [windows]
MOST_STANDARD_ERRORS = 3.0
SHAPE = GnnShape(num_features=7, num_outputs=2, edges="reference")
PARTS = {  # our parts by theirs
    "encoder.node": "encoder/node_model",
    "encoder.edge": "encoder/edge_model",
    "core.node": "graph_net/node_block",
    "core.edge": "graph_net/edge_block",
    "decoder.node": "decoder/node_model",
}
CARD = """# The trained policy of Tolstaya et al.

Weights by the authors of *Learning Connectivity for Data Distribution in Robot Teams*, MIT licence;
converted by `tools/reference_policy.py`. Fly it with `--preset reference`.
"""
OUTPUT = "policy_model/output/node_model/node_output"


def network_of(path: Path) -> AggregationGnn:
    """Return the acting network of the authors' weights.

    Raises:
        ValueError: The file cannot be read, is damaged, or holds other arrays.
    """
    content = io.BytesIO(read_file(path, "weights", MOST_BYTES))
    try:
        with zipfile.ZipFile(content) as archive:
            if sum(entry.file_size for entry in archive.filelist) > MOST_BYTES:
                raise ValueError(f"its arrays may have up to {MOST_BYTES} bytes")
        with np.load(content, allow_pickle=False) as arrays:
            names = {"output": f"policy/{OUTPUT}/"} | {
                f"{ours}.{layer}": f"policy/{theirs}/mlp/linear_{layer}/"
                for ours, theirs in PARTS.items()
                for layer in range(SHAPE.depth)
            }
            weights = {}
            for ours, theirs in names.items():
                weights[f"{ours}.weight"] = torch.from_numpy(arrays[f"{theirs}w"].T.copy())
                weights[f"{ours}.bias"] = torch.from_numpy(arrays[f"{theirs}b"])
        network = AggregationGnn(SHAPE)
        network.load_state_dict(weights)
    except Exception as error:  # of a damaged file, NumPy, zipfile and zlib raise one each
        reason = " ".join(str(error).split())
        raise ValueError(f"{path} does not hold the authors' weights: {reason:.200}") from error
    return network


def store(path: Path, policy: Path) -> None:
    """Write the authors' weights as a policy."""
    config = GnnConfig(
        network=SHAPE,
        features="reference",
        training={"weights": "by Tolstaya et al., MIT licence", "task": "stationary"},
        evaluation={"published_aoi": THEIR_AOI, "published_sem": THEIR_SEM},
        commit=None,
        version=version(),
    )
    save_gnn(policy, network_of(path), config, card=CARD)


def costs_of(policy: Path, episodes: int, seed: int, num_jobs: int) -> list[float]:
    """Return each mission's mean age of information under the `reference` preset [windows]."""
    study = Study(
        policies=(str(policy),), regimes=(reference("stationary"),), episodes=episodes, seed=seed
    )
    flown = dict(Local(num_jobs=num_jobs).run(fly_batch, study.batches))
    return [aoi for index in sorted(flown) for aoi in flown[index].aoi]


@dataclass(frozen=True, kw_only=True)
class Options:
    """Whose weights, and on which missions."""

    EPILOG: ClassVar = (
        "Exit codes: 0 the costs agree, 1 they are too far apart, or the machine failed, 2 bad "
        "input."
    )
    weights: Path = setting(help="the authors' .npz", is_positional=True)
    out: Path | None = setting(None, "keep the policy here", metavar="FILE.safetensors")
    episodes: int = setting(100, "missions", low=2, high=100_000)
    seed: int = setting(2000, "of the first mission")
    jobs: int = setting(2, "processes", low=1, high=256)


def run(options: Options) -> int:
    """Fly the policy and compare; return 1 if the costs are too far apart."""
    tell_cores(options.jobs)
    with tempfile.TemporaryDirectory() as scratch:
        policy = options.out or Path(scratch) / "policy.safetensors"
        store(options.weights, policy)
        costs = costs_of(policy, options.episodes, options.seed, options.jobs)
    mean, sem = float(np.mean(costs)), float(np.std(costs, ddof=1) / math.sqrt(len(costs)))
    apart = (mean - THEIR_AOI) / math.hypot(sem, THEIR_SEM)
    print(f"here {mean:.2f} ± {sem:.2f} windows over {len(costs)} missions")
    print(f"published {THEIR_AOI} ± {THEIR_SEM}: {apart:+.2f} combined standard errors apart")
    return 0 if abs(apart) <= MOST_STANDARD_ERRORS else TOO_FAR


if __name__ == "__main__":
    sys.exit(script(Options, run))
