"""Mistakes that once passed every check, each planted in a copy: what catches it, and where.

The type checker or a test of about a second says the file and the line of each. So nothing that is
declared can be misspelt, half declared or left out in silence.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
COPIED = ("swarm_mj", "tests", "tools", "training")


def line_of(text, part):
    """The line on which a part of a text begins, which must stand there once."""
    assert text.count(part) == 1, f"stands {text.count(part)} times, not once: {part}"
    return text[: text.index(part)].count("\n") + 1


@dataclass(frozen=True, kw_only=True)
class Mistake:
    """A small edit that ought not to pass.

    Args:
        name: What is wrong.
        file: The file that it is made in.
        before: What stands there, exactly once.
        after: What stands there then.
        caught_by: The test, or the file of tests, that fails; empty for the type checker.
        said: What it says, with `{line}` for the line of the mistake; of the type checker, a part.
        told_in: The file that the type checker complains about, unless it is the same.
        told_at: What begins on the line that it complains about, unless that is `after`.
        is_slow: Whether `make test` leaves it out, since another one is much like it.
    """

    name: str
    file: str
    before: str
    after: str
    said: str
    caught_by: str = ""
    told_in: str = ""
    told_at: str = ""
    is_slow: bool = False

    def plant(self, root: Path) -> int:
        """Make the mistake in a copy, whose file is no link any longer; return its line."""
        path = root / self.file
        text = path.read_text()
        line = line_of(text, self.before)
        path.unlink()
        path.write_text(text.replace(self.before, self.after))
        return line

    def place(self, root: Path) -> str:
        """Where the type checker complains, `file:line`, once all mistakes are in the copy."""
        told_in = self.told_in or self.file
        line = line_of((root / told_in).read_text(), self.told_at or self.after)
        return f"{told_in}:{line}"


FOR_THE_TYPE_CHECKER = [
    Mistake(
        name="a misspelt colour of the palette",
        file="swarm_mj/replay/layers.py",
        before="HEADING, width=0.8, order=29.0)",
        after="HEADNG, width=0.8, order=29.0)",
        said='"HEADNG" is not a known attribute of module',
    ),
    Mistake(
        name="a misspelt layer of replays",
        file="swarm_mj/replay/write.py",
        before="out.lines(layers.PARENTS,",
        after="out.lines(layers.PARENT,",
        said='"PARENT" is not a known attribute of module',
    ),
    Mistake(
        name="a misspelt material of an arena",
        file="swarm_mj/physics/arenas.py",
        before="_add(spec, BUILDING, BOX_SHAPE,",
        after="_add(spec, BUIDLING, BOX_SHAPE,",
        said='"BUIDLING" is not defined',
    ),
    Mistake(
        name="an arena whose material has no loss",
        file="swarm_mj/physics/materials.py",
        before='TREE = Material(\n    name="tree",\n    loss_db=6.0,',
        after='TREE = Material(\n    name="tree",',
        said='Argument missing for parameter "loss_db"',
    ),
    Mistake(
        name="a misspelt number of a flight's summary",
        file="swarm_mj/api/run.py",
        before="age = self.summary.aoi_mean",
        after="age = self.summary.aoi_meen",
        said='Cannot access attribute "aoi_meen" for class "FlightSummary"',
    ),
    Mistake(
        name="a policy that leaves out one of its facts",
        file="swarm_mj/policies/greedy_oracle.py",
        before='about = Listed(\n        name="greedy-oracle",',
        after="about = Listed(",
        said='Argument missing for parameter "name"',
    ),
    Mistake(
        name="a column of Result that says no way to compute it",
        file="swarm_mj/evaluation/results.py",
        before="aoi_worst: float = column(lambda own: own.aoi.worst)",
        after="aoi_worst: float = column()",
        said='Argument missing for parameter "value"',
    ),
    Mistake(
        name="a column of Result that is computed from what nobody measures",
        file="swarm_mj/evaluation/results.py",
        before="aoi_p95: float = column(lambda own: own.aoi.p95)",
        after="aoi_p95: float = column(lambda own: own.aoi.p59)",
        said='Cannot access attribute "p59"',
    ),
    Mistake(
        name="a misspelt choice that nothing is ever equal to",
        file="swarm_mj/physics/worlds.py",
        before='if self._mission.physics == "exact":',
        after='if self._mission.physics == "exct":',
        said="Condition will always evaluate to False",
    ),
    Mistake(
        name="knowledge that no mission can grant",
        file="swarm_mj/simulation/swarm.py",
        before='mission.grants("start")',
        after='mission.grants("strat")',
        said="'strat'",
    ),
    Mistake(
        name="a task without its controller",
        file="swarm_mj/mission/team.py",
        before='Task = Literal["stationary", "random-walk", "flocking"]',
        after='Task = Literal["stationary", "random-walk", "flocking", "patrol"]',
        said="patrol",
        told_in="swarm_mj/control/motion.py",
        told_at="assert_never(mission.task)",
    ),
    Mistake(
        name="a mission field whose help stands under a misspelt label",
        file="swarm_mj/mission/impairments.py",
        before='        "largest drift of a clock",',
        after='        hepl="largest drift of a clock",',
        said='No parameter named "hepl"',
    ),
    Mistake(
        name="a misspelt keyword of swarm_mj.fly",
        file="tools/same.py",
        before='swarm_mj.fly(flight.task, policy="tdma",',
        after='swarm_mj.fly(flight.task, polcy="tdma",',
        said='No parameter named "polcy"',
    ),
    Mistake(
        name="a misspelt field of a preset's mission",
        file="swarm_mj/cli/bench_learning.py",
        before='paper("stationary", num_robots=num_robots)',
        after='paper("stationary", num_robot=num_robots)',
        said='No parameter named "num_robot"',
    ),
    Mistake(
        name="a field of a mission that has another type",
        file="tools/diagrams.py",
        before='paper("stationary", num_robots=2)',
        after='paper("stationary", num_robots="2")',
        said='Argument of type "Literal[\'2\']" cannot be assigned to parameter "num_robots"',
    ),
]

EFFECTS = "tests/radio/test_effects.py"
ERASURE = "    erasure: float = setting(\n"
JITTER = """\
    jitter_db: float = setting(
        0.0,
        "how much the power of packets varies",
        label="jitter",
        unit="dB",
        low=0.0,
        high=30.0,
        source=NEW,
        group=CHANNEL,
    )
"""
DISTANCE = '    distance: Annotated[float, Feature("distance")]  # of `FAR_RANGES`\n'
AGE = '    timestamp_age: Annotated[float, Feature("age of T")]\n'

FOR_TESTS = [
    Mistake(
        name="a mission field that type checkers are not told of",
        file="swarm_mj/mission/impairments.py",
        before="    erasure: float\n",
        after="",
        caught_by=(
            "tests/mission/test_keywords.py::test_type_checkers_are_told_of_every_field_by_its_type"
        ),
        said="MissionFields lacks the line `erasure: ",
    ),
    Mistake(
        name="a layer of replays whose path is misspelt",
        file="swarm_mj/replay/layers.py",
        before='TRAILS = Lines(path="arena/trail"',
        after='TRAILS = Lines(path="arean/trail"',
        caught_by="tests/replay/test_layers.py::test_paths_are_layers_own_and_below_a_view",
        said=r"swarm_mj/replay/layers\.py:{line}: arean/trail is below none of the views",
        is_slow=True,
    ),
    Mistake(
        name="a policy that says nothing of itself",
        file="swarm_mj/policies/greedy_oracle.py",
        before="    about = Listed(",
        after="    told = Listed(",
        caught_by="tests/policies/test_about.py",
        said=r"TypeError: class GreedyOracle in swarm_mj\.policies\.greedy_oracle must declare",
        is_slow=True,
    ),
    Mistake(
        name="a column of Result that nobody fills",
        file="swarm_mj/evaluation/results.py",
        before="    aoi_std: float | None = column(lambda own: own.aoi.std)\n",
        after="    aoi_std: float | None\n",
        caught_by="tests/evaluation/test_results.py",
        # On import, which is said with the file and its line.
        said=(
            r"swarm_mj/evaluation/results\.py:\d+: in <module>(.|\n)*"
            "nothing computes the column aoi_std of Result"
        ),
    ),
    Mistake(
        name="a mission field that no radio reads",
        file="swarm_mj/mission/impairments.py",
        before=ERASURE,
        after=JITTER + ERASURE,
        caught_by=f"{EFFECTS}::test_every_number_of_the_channel_is_read_once",
        said=r"swarm_mj/mission/impairments\.py:{line}: jitter_db is read by no effect",
    ),
    Mistake(
        name="an effect that is left out of the list",
        file="swarm_mj/radio/effects.py",
        before="    Erasure,\n",
        after="",
        caught_by=f"{EFFECTS}::test_every_number_of_the_channel_is_read_once",
        said=r"swarm_mj/mission/impairments\.py:\d+: erasure is read by no effect",
    ),
    Mistake(
        name="an effect that does nothing",
        file="swarm_mj/radio/effects.py",
        before="model.reception._replace(erasure=self.probability)",
        after="model.reception._replace()",
        caught_by=f"{EFFECTS}::test_an_effect_makes_another_channel_and_is_named",
        said=r"swarm_mj/radio/effects\.py:\d+: Erasure changes no number of the channel",
        is_slow=True,
    ),
    Mistake(
        name="an effect that no mission has",
        file="swarm_mj/radio/effects.py",
        before="if mission.erasure == 0.0:",
        after="if mission.erasure >= 0.0:",
        caught_by=f"{EFFECTS}::test_an_effect_makes_another_channel_and_is_named",
        said=r"swarm_mj/radio/effects\.py:\d+: Erasure is had by no mission",
        is_slow=True,
    ),
    Mistake(
        name="two features that change places",
        file="swarm_mj/policies/gnn/extended_features.py",
        before=AGE + DISTANCE,
        after=DISTANCE + AGE,
        caught_by=(
            "tests/policies/gnn/test_feature_sets.py"
            "::test_the_sets_are_what_policies_of_1_0_were_trained_on[extended]"
        ),
        said=(
            r"swarm_mj/policies/gnn/extended_features\.py:{line}: number 3 of the extended "
            "features was 'age of T' and is 'distance' now"
        ),
    ),
]


def link(source, target):
    """Make a file of the copy: another name of the same file where the file system can do that."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


@pytest.fixture
def copy(tmp_path):
    """A copy of all that tests need, with what numba has compiled."""
    for folder in COPIED:
        skipped = shutil.ignore_patterns("results") if folder == "training" else None
        shutil.copytree(ROOT / folder, tmp_path / folder, copy_function=link, ignore=skipped)
    shutil.copy2(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def run(arguments, root):
    """Run a module of this Python in a copy, as by hand, and return what happened."""
    command = [sys.executable, "-m", *arguments]
    return subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)


def errors_of_types(root, files):
    """The errors that the type checker finds in some files of a copy, by `file:line`."""
    project = tomllib.loads((root / "pyproject.toml").read_text())
    settings = project["tool"]["basedpyright"] | {"include": files}
    (root / "pyrightconfig.json").write_text(json.dumps(settings))  # takes the place of the other
    done = run(["basedpyright", "--outputjson", "--pythonpath", sys.executable], root)
    found = {}
    for each in json.loads(done.stdout)["generalDiagnostics"]:
        if each["severity"] == "error":
            file = Path(each["file"]).relative_to(root)
            line = each["range"]["start"]["line"] + 1
            found.setdefault(f"{file}:{line}", []).append(each["message"])
    return found


@pytest.mark.slow
def test_the_type_checker_says_file_and_line(copy):
    """All in one copy, for the type checker reads every file that they import, each time anew."""
    for mistake in FOR_THE_TYPE_CHECKER:
        mistake.plant(copy)
    files = {mistake.told_in or mistake.file for mistake in FOR_THE_TYPE_CHECKER}
    found = errors_of_types(copy, sorted(files))
    for mistake in FOR_THE_TYPE_CHECKER:
        place = mistake.place(copy)
        said = "; ".join(found.get(place, []))
        assert mistake.said in said, (mistake.name, place, found)


def each_alone():
    """Every mistake that a test catches, by its name."""
    for mistake in FOR_TESTS:
        marks = [pytest.mark.slow] if mistake.is_slow else []
        yield pytest.param(mistake, id=mistake.name, marks=marks)


@pytest.mark.slow
@pytest.mark.parametrize("mistake", list(each_alone()))
def test_a_short_test_says_file_and_line(copy, mistake):
    line = mistake.plant(copy)
    done = run(["pytest", "-q", "-x", "-p", "no:cacheprovider", mistake.caught_by], copy)
    assert done.returncode in (1, 2), done.stdout  # a test failed, or its file could not be read
    said = mistake.said.replace("{line}", str(line))
    assert re.search(said, done.stdout), done.stdout
