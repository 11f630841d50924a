"""Train the network that corrects the plan of stationary teams.

    cd training/examples
    python -m residual_gnn.train

A run that has begun goes on where it was, with the same options but for the minutes; stopped by
Ctrl-C or killed, it loses the improvement under way and nothing else. At the end the best networks,
and the rule without one, fly fresh test missions; the best of them becomes `weights.safetensors` in
the run's folder.
"""

import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from residual_gnn.ppo import PpoSettings
from residual_gnn.stored import save_weights
from residual_gnn.training_run import (
    CURVE,
    DEFAULT_PPO,
    Progress,
    ResidualTraining,
    Run,
    train,
)
from swarm_mj.cli import script
from swarm_mj.mission import Mission, paper
from swarm_mj.mission.keywords import MissionFields
from swarm_mj.system.fields import as_typed, setting
from swarm_mj.system.packages import commit
from swarm_mj.system.writing import Output, check_outputs, owned

WINDOWS = 250  # of a mission that is learned from
KINDS: dict[str, MissionFields] = {  # what 40 robots at rest meet; they believe in free space
    "free space": {},
    "30 % erased": {"erasure": 0.3},
    "shadowing": {"shadowing_db": 6.0},
    "Rayleigh": {"fading": "rayleigh"},
    "bursts": {"burst_begin": 0.02},
    "blocks": {"arena": "blocks"},
    "10 % off": {"failure_fraction": 0.1},
}


@dataclass(frozen=True, kw_only=True)
class Residual:
    """How long to train, and where everything goes."""

    minutes: float = setting(
        30.0,
        "of training in all, without evaluations; those of a run that goes on count",
        low=0.01,
        high=10_000.0,
    )
    seed: int = setting(0, "of all that is drawn", low=0, high=2**31)
    out: Path = setting(
        Path("runs/residual_gnn"),
        "the run; one that has begun goes on, with the same options but for the minutes",
        metavar="DIR",
        shown="runs/residual_gnn",
    )
    learning_rate: float = setting(DEFAULT_PPO.learning_rate, "of Adam", low=1e-9, high=1.0)
    corrects_turns: bool = setting(
        False, "let the network decide before everyone's plan is in force, too"
    )
    epochs: int = setting(
        DEFAULT_PPO.epochs, "passes over the decisions of an improvement", low=1, high=100
    )
    robots: int = setting(40, "in a team", low=2, high=200)
    windows: int = setting(WINDOWS, "of a mission", low=100, high=10_000)
    together: int = setting(4, "missions of each kind between two improvements", low=1, high=1000)
    places: int = setting(40, "where robots may stand, of each kind", low=1, high=10_000)
    held_out: int = setting(8, "missions of each kind in an evaluation", low=1, high=1000)

    def __call__(self) -> int:
        """Train, choose, write; return the exit code.

        Raises:
            ValueError: The run's folder is another run's or damaged.
            OSError: Something cannot be read or written.
        """
        policy = self.out / "weights.safetensors"
        check_outputs(Output("policy", policy))
        with owned(self.out / CURVE):
            _said("flying the rule alone, or reading how far the run is")
            run = Run(self.training(), self.out)
            _said(f"{self.out} stands at {run.progress.improvements} improvements")
            train(run, self.minutes, _said)
            _said("choosing among the best and the rule alone, on other missions")
            at, weights, ratios = run.choose()
            if not at:
                _said("the rule alone is best, so no weights are written; train for longer")
                return 0
            card = self._card(run.progress, at, ratios)
            save_weights(policy, weights, card)
        _said(f"{policy}: made after {at} improvements, {ratios[at]:.3f} of the rule's age")
        return 0

    def _command(self) -> str:
        """Return the command line, with all options that differ from the defaults."""
        words = ["python -m residual_gnn.train"]
        for spec in fields(self):
            value = getattr(self, spec.name)
            if spec.name != "out" and value != spec.default:
                flag = f"--{spec.name.replace('_', '-')}"
                words.append(flag if value is True else f"{flag} {as_typed(value)}")
        return " ".join(words)

    def training(self) -> ResidualTraining:
        """Return the settings of the training."""
        return ResidualTraining(
            missions={name: self._mission(channel) for name, channel in KINDS.items()},
            ppo=PpoSettings(learning_rate=self.learning_rate, epochs=self.epochs),
            corrects_turns=self.corrects_turns,
            seed=self.seed,
            together=self.together,
            places=self.places,
            held_out=self.held_out,
        )

    def _mission(self, channel: MissionFields) -> Mission:
        team: MissionFields = {"num_robots": self.robots, "num_windows": self.windows}
        return paper("stationary", **(team | channel))

    def _card(self, progress: Progress, at: int, ratios: dict[int, float]) -> str:
        """Return the model card: training, settings and selection."""
        training = asdict(self.training())
        training.pop("missions")
        settings = training.pop("ppo") | training
        listed = "\n".join(f"- {name}: {value}" for name, value in settings.items())
        kinds = "\n".join(f"- {name}{_options(channel)}" for name, channel in KINDS.items())
        chosen = "\n".join(
            f"- {n} improvements: {ratio:.3f}{' (this one)' if n == at else ''}"
            for n, ratio in sorted(ratios.items())
        )
        return CARD.format(
            width=self.training().width,
            listed=listed,
            turns="; so do those that still take turns"
            if self.corrects_turns
            else "; no others do",
            kinds=kinds,
            chosen=chosen,
            robots=self.robots,
            windows=self.windows,
            minutes=progress.seconds / 60,
            held_out=self.held_out,
            command=self._command(),
            commit=commit(),
        )


CARD = """# A learned correction of a plan, of swarm_mj

A stationary team derives one plan from positions and the clock (`planner --payload none`). In every
slot, each robot that decides evaluates this network on what it remembers of its neighbours. It then
draws whether to transmit, whatever the plan says. Robots that follow the plan decide{turns}.

- network: graph neural network of one hop, width {width}, over believed neighbours
- packets: T, M and P, as in the paper
- stationary teams only

## Fly it

    cd training/examples
    swarm-mj fly --policy residual_gnn:policy --task stationary

## Training

PPO with each packet's counterfactual advantage: {minutes:.0f} minutes on one core, {robots}
robots, {windows} windows a mission, of these kinds in turn:

{kinds}

{listed}

    {command}

Commit {commit}.

## Choice

Mean age relative to the rule alone, on {held_out} missions of each kind not used during training.
The best of several noisy evaluations is biased:

{chosen}

## Licence

Apache-2.0, as swarm_mj.
"""


def _options(channel: Mapping[str, object]) -> str:
    """Return a kind's options, as they are typed."""
    typed = (f"`--{name.replace('_', '-')} {value}`" for name, value in channel.items())
    return ": " + " ".join(typed) if channel else ""


def _said(line: str) -> None:
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


if __name__ == "__main__":
    sys.exit(script(Residual, Residual.__call__))
