"""`swarm_mj.evaluate`: policies on the same missions, as `swarm-mj evaluate` compares them."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Unpack, get_args

from swarm_mj.api.flight_summary import Metrics
from swarm_mj.api.fly import mission_of, names_of
from swarm_mj.evaluation.batch import BatchCosts
from swarm_mj.evaluation.engines import EngineName, EngineOptions
from swarm_mj.evaluation.flying import fly_study
from swarm_mj.evaluation.results import Evaluated, Result
from swarm_mj.evaluation.study import DEFAULT_POLICIES, Study
from swarm_mj.evaluation.study_needs import study_needs
from swarm_mj.evaluation.summary import study_results, write_evaluated
from swarm_mj.evaluation.table import results_text
from swarm_mj.mission import Mission, PresetAndFields
from swarm_mj.policies.registry import listed
from swarm_mj.simulation.components import Components
from swarm_mj.system.arguments import checked_choice
from swarm_mj.system.fields import check_value
from swarm_mj.system.needs import check_fits, memory_errors
from swarm_mj.system.packages import need
from swarm_mj.system.terminal import quiet_console
from swarm_mj.system.writing import Output, check_outputs

if TYPE_CHECKING:  # each is slow to import
    from matplotlib.figure import Figure
    from pandas import DataFrame

# pandas prints only the ends of a wide table, so these columns stand there.
FIRST = ("policy", "num_robots", "aoi_mean", "aoi_sem")
LAST = ("aoi_ci_low", "aoi_ci_high", "packets_per_window")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Evaluation:
    """Costs of policies on the same missions; tables need pandas, charts matplotlib.

    Printed, it is the table of `swarm-mj evaluate`.

    Example:
        ```python
        import swarm_mj

        found = swarm_mj.evaluate(
            ["tdma", "mst"], "random-walk", num_missions=3, num_robots=8, num_windows=50
        )
        print(found)
        print(found.summary["tdma"].aoi_mean)  # [windows]
        found.save("results.csv")
        ```
    """

    mission: Mission  # the missions' numbers
    results: Sequence[Evaluated]  # each policy's costs, in the order named

    def __repr__(self) -> str:
        """Return the table that `swarm-mj evaluate` prints."""
        return results_text(self._rows)

    def _repr_html_(self) -> str:
        """Return the main columns of `to_dataframe`, for notebooks."""
        shown = [*FIRST[2:], *LAST]
        return self.to_dataframe().set_index("policy")[shown].to_html()

    @property
    def summary(self) -> Metrics:
        """Costs by policy, then by column of the CSV: `summary["tdma"].aoi_mean` [windows]."""
        return Metrics({each.policy: Metrics(asdict(each)) for each in self._rows})

    @property
    def _rows(self) -> list[Result]:
        return [each.result for each in self.results]

    def to_dataframe(self, *, by_mission: bool = False) -> "DataFrame":
        """Return the costs as a table of pandas.

        Args:
            by_mission: Whether to return a row per policy and mission.

        Returns:
            A row per policy, with the columns of `swarm-mj evaluate --csv`. By mission instead
            `policy`, `seed`, `aoi` [windows], `velocity_variance` [m²/s²], and `task_cost`, in
            the unit of the controller, where the task has one. Flocks also have `agreed_window`
            (the first from which on under 1 % of the first velocity variance is left),
            `decay_rate` [1/window] and `strayed` (robots out of everyone's range at the end).

        Raises:
            ModuleNotFoundError: pandas is missing; the message says how to install it.
        """
        need("pandas", "a table")
        from pandas import DataFrame

        if not by_mission:
            table = DataFrame(asdict(each) for each in self._rows)
            others = table.columns.difference([*FIRST, *LAST], sort=False)
            return table.reindex(columns=[*FIRST, *others, *LAST])
        rows: list[dict[str, str | int | float | None]] = []
        for each in self.results:
            for index in range(len(each.aoi)):
                row: dict[str, str | int | float | None] = {
                    "policy": each.result.policy,
                    "seed": each.result.seed + index,
                }
                for name, values in each.numbers.items():
                    row[name] = values[index]
                rows.append(row)
        return DataFrame(rows)

    def plot(self) -> "Figure":
        """Draw each policy's age of information, lowest first, with its 95 % interval.

        Returns:
            matplotlib's figure; of a flock it has the velocity variance as well.

        Raises:
            ModuleNotFoundError: matplotlib is missing; the message says how to install it.
        """
        need("matplotlib", "a chart")
        from swarm_mj.api.charts import draw_evaluation

        return draw_evaluation(self._rows)

    def save(self, path: str | Path) -> Path:
        """Write what `swarm-mj evaluate` does, replacing the file if it exists.

        Args:
            path: Ends in .csv, one row per policy, .json, with what each mission cost as well, or
                .parquet, one row per mission.

        Returns:
            The path.

        Raises:
            ValueError: The path ends otherwise.
            OSError: The file cannot be written.
        """
        path = Path(path)
        check_outputs(Output("the file", path, ".csv|.json|.parquet"))
        write_evaluated(path, self.results)
        return path


def evaluate(
    policies: str | Path | Sequence[str | Path] = DEFAULT_POLICIES,
    task: str | Mission | None = None,
    *,
    num_missions: int = 100,
    seed: int = 1000,
    baseline: str | Path | None = None,
    probability: float | None = None,
    is_deterministic: bool = False,
    channel: str | None = None,
    controller: str | None = None,
    scene: str | None = None,
    pilot: str | None = None,
    features: str | Sequence[str] = (),
    networks: str | Sequence[str] = (),
    num_jobs: int = 1,
    engine: str = "local",
    address: str | None = None,
    **mission_fields: Unpack[PresetAndFields],
) -> Evaluation:
    """Fly each policy over the same missions, and average the costs of each.

    The same arguments give the same numbers as `swarm-mj evaluate` does. On a terminal, a bar shows
    how far it is.

    Args:
        policies: Names of `POLICIES`, folders of learned ones, or `module:Name` of your own;
            `__main__:Name` is a class of this script or notebook. "all" is all of `POLICIES`.
        task: The robots' task by name, or a `Mission`. None is as in `fly`.
        num_missions: Of each policy.
        seed: Of the first mission; the others follow one by one.
        baseline: The policy that others are compared with, mission by mission; the first unless
            given.
        probability: The transmission probability of random policies; tuned unless given.
        is_deterministic: Whether learned policies take their most probable recipient, not a draw.
        channel: Who decodes whom, by `module:Name`; the mission's radio unless given.
        controller: What drives the robots, likewise; that of the task unless given.
        scene: A function that edits the MuJoCo model, likewise; none unless given.
        pilot: What makes the controls of robots with bodies, likewise; the robot's unless given.
        features: Names of your own feature extractors that learned policies were trained with.
        networks: Names of your own networks that they decide by.
        num_jobs: Processes. With more than one, a script must guard what it runs by
            `if __name__ == "__main__":`, as Python's multiprocessing says.
        engine: Where they are: "local", "ray" or "slurm"; docs/cluster.md tells more.
        address: Of a running Ray cluster, such as "auto"; unless given, Ray starts one here.
        **mission_fields: Any field of `Mission`, in its unit, such as `num_robots=20`.

    Returns:
        The costs: a table when printed, `summary` by policy, tables of pandas, a chart, and files.

    Raises:
        ValueError: A value is unknown or out of range, or memory does not suffice.
        TypeError: An argument is of the wrong kind, or unknown.
        ModuleNotFoundError: SciPy is missing, which finds intervals, or what the engine needs.
        OSError: The engine could not do all of it.
        KeyboardInterrupt: Ctrl-C; nothing is kept.

    Example:
        ```python
        import swarm_mj

        found = swarm_mj.evaluate(
            ["planner", "tdma"], "stationary", num_missions=5, num_robots=8, num_windows=50
        )
        print(found)  # the first policy is the baseline
        ```
    """
    need("scipy", "an evaluation")
    mission = mission_of(evaluate, task, mission_fields)
    components = {"channel": channel, "controller": controller, "scene": scene, "pilot": pilot}
    for kind, name in components.items():
        check_named("evaluate", kind, name)
    check_value(EngineOptions.__dataclass_fields__["jobs"], num_jobs, "num_jobs")
    check_value(Study.__dataclass_fields__["episodes"], num_missions, "num_missions")
    study = Study(
        policies=_names(policies),
        regimes=(mission,),
        episodes=num_missions,
        seed=seed,
        probability=probability,
        is_deterministic=is_deterministic,
        baseline=None if baseline is None else str(baseline),
        features=names_of(features),
        networks=names_of(networks),
        components=Components(**components),
    )
    chosen = checked_choice("engine", engine, get_args(EngineName))
    options = EngineOptions(jobs=num_jobs, engine=chosen, address=address)
    study_engine = options.engine_for(study)
    needs = study_needs(study, options.jobs_here)
    way_out = "choose fewer num_jobs, num_robots, num_windows or num_missions"
    check_fits(needs, None, way_out, is_forced=False, way_on="")
    costs: dict[int, BatchCosts] = {}
    with memory_errors():
        fly_study(study, costs, study_engine, None, quiet_console())
    return Evaluation(mission=mission, results=study_results(study, costs, study.header()))


def check_named(function: str, kind: str, part: object) -> None:
    """Raise TypeError for a part that is an object: other processes make theirs by name."""
    if not isinstance(part, str | Path | None):
        why = "it flies missions in several processes, which each make their own"
        rule = f'{function} takes the {kind} by name, such as "my_file:Name"'
        raise TypeError(f"{rule}, not {part!r:.80}: {why}")


def _names(policies: str | Path | Sequence[str | Path]) -> tuple[str, ...]:
    if isinstance(policies, str) or not isinstance(policies, Iterable):
        policies = [policies]
    names = list(policies)  # what is given may be gone through once only
    for name in names:
        check_named("evaluate", "policy", name)
    return tuple(listed(map(str, names)))
