"""Writes the files of this folder with version 1.0.0, which README.md names; see there how.

Each file is made by a command line of 1.0.0, which stands here whole, but for the few that only
Python makes. They go into `files.tar.xz`, beside what a user would have written: `INPUTS`.
"""

import dataclasses
import importlib
import inspect
import json
import os
import re
import shutil
import sys
import tarfile
from contextlib import redirect_stdout
from importlib import metadata
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

VERSION = "1.0.0"
installed_version = metadata.version


def version_of(package):
    """Return a package's version; the checkout of 1.0.0 is not installed, so we say its own."""
    return VERSION if package == "swarm_mj" else installed_version(package)


metadata.version = version_of

import swarm_mj  # noqa: E402 - its files name the version
from swarm_mj.cli import COMMANDS, main  # noqa: E402

ROOT = Path(swarm_mj.__file__).parents[1]
HERE = Path(__file__).parent.resolve()
INPUTS = ("arena.xml", "gains.csv", "own_parts.py", "paper.toml", "study.toml")
TINY = "--robots 4 --windows 20 --range-ratio 0.6"
NETWORK = "--latent 4 --depth 1 --receptive-field 1 --threads 1 --device cpu"
TRAINED = f"{TINY} {NETWORK} --held-out 2 --evaluate-every 128 --budget 256"
# Policies by the features that they see; those of a team's reward are the paper's way.
POLICIES = {
    "extended": "--missions 4",
    "local": "--features local --missions 4",
    "buffer": "--features buffer --missions 4",
    "own": "--features own_parts:Ages --missions 4",
    "paper": "--credit team --missions 4",
    "reference": "--credit team --preset reference --missions 4",
}
WHOLE = ("extended", "paper")  # whose runs are kept, not only the policies
REPLAYS = {
    "flock": "--task flocking --policy gossip --robots 6 --windows 10",
    "city": "--preset urban --policy csma --robots 5 --windows 10 --failure-fraction 0.2",
}
EVALUATED = (
    "--policy planner random-flooding mst --episodes 2 --task stationary flocking "
    "--robots 5 --windows 20 --range-ratio 0.6 --seed 2000"
)


def run(line):
    """Run a command line; return what it printed."""
    sys.stderr.write(f"swarm-mj {line}\n")
    printed = StringIO()
    with redirect_stdout(printed):
        code = main(line.split())
    if code:
        raise SystemExit(f"swarm-mj {line}: exit code {code}\n{printed.getvalue()}")
    return printed.getvalue()


def write_results():
    """Write results in each form, and a progress file as Ctrl-C leaves it."""
    run(f"evaluate {EVALUATED} --json evaluation.json --csv evaluation.csv")
    files = "--json study.json --csv study.csv --parquet study.parquet"
    run(f"study run study.toml {files}")
    run("study run paper.toml --csv paper.csv --parquet paper.parquet")
    drawn = "--task stationary --robots 40 --range-ratio 0.25 0.5 --policy random-flooding mst"
    run(f"evaluate {drawn} --episodes 2 --seed 2000 --csv drawn.csv")
    run("fly --policy planner --robots 5 --windows 20 --no-record --json flight.json")
    run("bench --missions 1 --seconds 0.1 --episodes 2 --jobs 1 --json bench.json")
    run("bench --robots 4 6 --seconds 0.1 --json bench-teams.json")

    flying = importlib.import_module("swarm_mj.evaluation.flying")
    append = flying.append_progress

    def append_one(*arguments):
        append(*arguments)
        raise KeyboardInterrupt

    flying.append_progress = append_one
    try:
        main(["study", "run", "paper.toml", "--csv", "begun.csv"])
    finally:
        flying.append_progress = append


def write_policies():
    """Write a stored policy of each kind; of some, the whole runs."""
    for name, options in POLICIES.items():
        folder = Path("runs", name)
        run(f"train --out runs/{name} {options} {TRAINED}")
        if name in WHOLE:
            continue
        (folder / "policy.safetensors").rename(f"{name}.safetensors")
        shutil.rmtree(folder)
    shutil.copyfile(ROOT / "assets/policies/gnn.safetensors", "gnn.safetensors")

    from sb3_contrib import MaskablePPO
    from stable_baselines3 import A2C, PPO

    from swarm_mj.envs.sb3 import make_vec_env, save_policy

    for kind in (MaskablePPO, PPO, A2C):
        env = make_vec_env("stationary", 2, num_robots=4, num_windows=20, reward="credit")
        policy = {"net_arch": [8]}
        model = kind("MultiInputPolicy", env, n_steps=8, seed=1000, policy_kwargs=policy)
        model.learn(64)
        save_policy(model, f"sb3-{kind.__name__.lower()}")


def write_worlds():
    """Write replays, and the scene of a mission."""
    for name, options in REPLAYS.items():
        run(f"fly {options} --record {name}.rrd")
    run("scene --arena blocks --task random-walk --robots 5 --out scene.xml")


def write_surface():
    """Write what a user may type, import and read: options, fields, policies, names in Python."""
    mission = dataclasses.asdict(swarm_mj.paper("flocking"))
    study = importlib.import_module("swarm_mj.evaluation.study").Study
    features = importlib.import_module("swarm_mj.policies.gnn.feature_sets").FEATURE_SETS
    surface = {
        "commands": {name: options(name) for name in COMMANDS},
        "mission": mission,
        "study": [spec.name for spec in dataclasses.fields(study)],
        "policies": [each["name"] for each in json.loads(run("policies --json"))],
        "policies --json": sorted(json.loads(run("policies planner --json"))),
        "doctor --json": sorted(json.loads(run("doctor --json"))["findings"][0]),
        "features": sorted(features),
        "python": {name: described(name, its) for name, its in public_names().items()},
    }
    text = json.dumps(surface, indent=1)
    (HERE / "surface.json").write_text(shorter(text) + "\n")


def shorter(text):
    """Return JSON with each list of plain values in one line."""
    return re.sub(r"\[[^\[\]{}]*\]", lambda found: " ".join(found[0].split()), text)


def options(command):
    """Return a command's options: their flags, former ones too, and values that they take."""
    module = importlib.import_module(f"swarm_mj.cli.{command}")
    parsers = importlib.import_module("swarm_mj.cli.options")
    kind = getattr(module, f"{command.title()}Options")
    specs = {}
    for spec in parsers._options_of(kind):
        specs[spec.metadata.get("place", spec.name)] = spec
    found = []
    for action in parsers._parser_of(kind, command, "")._actions:
        if action.dest in specs:
            takes = values(specs[action.dest]) if action.nargs != 0 else []
            about = {"flags": action.option_strings, "metavar": action.metavar}
            found.append(about | {"values": takes})
    return found


def values(spec):
    """Return values that an option takes, as typed: its choices, its default, or the least."""
    if "choices" in spec.metadata:
        return list(spec.metadata["choices"])
    if isinstance(spec.default, (int, float, str)):
        return [str(spec.default)]
    if isinstance(spec.default, tuple) and spec.default:
        return [str(each) for each in spec.default]
    return [str(spec.metadata["low"])] if "low" in spec.metadata else []


def public_names():
    """Return the names of docs/api.md, which are stable through all versions 1.x.

    Each has the members that the page describes, or None for all.
    """
    named = {}
    entry = r"^::: (\S+)(?:\n    options:(?:\n      .*?)*?\n      members: \[(.*)\])?$"
    for found in re.finditer(entry, (ROOT / "docs/api.md").read_text(), flags=re.MULTILINE):
        named[found[1]] = found[2].split(", ") if found[2] else None
    return named


def described(name, members):
    """Return the arguments of a public name, and the attributes and methods of a class."""
    module, _, attribute = name.rpartition(".")
    thing = getattr(importlib.import_module(module), attribute)
    about = {"arguments": arguments(thing) if callable(thing) else []}
    if not isinstance(thing, type):
        return about
    about["attributes"] = []
    about["methods"] = {}
    for base in thing.__mro__:
        if not base.__module__.startswith("swarm_mj"):
            continue
        declared = inspect.get_annotations(base)
        for each in dict.fromkeys([*vars(base), *declared]):
            is_described = members is None or each in members or each in declared
            is_hidden = each.startswith("_") and each != "__call__"
            if is_hidden or not is_described:
                continue
            if inspect.isfunction(vars(base).get(each)):
                about["methods"][each] = arguments(vars(base)[each])
            elif each not in about["attributes"]:
                about["attributes"].append(each)
    return about


def arguments(thing):
    """Return the names of a function's or class's arguments; `*` stands before keywords."""
    kinds = inspect.Parameter
    try:
        parameters = inspect.signature(thing).parameters.values()
    except ValueError:  # of what is not Python's own
        return []
    found = []
    for each in parameters:
        if each.name == "self" or each.kind in (kinds.VAR_KEYWORD, kinds.VAR_POSITIONAL):
            continue
        mark = "*" if each.kind is kinds.KEYWORD_ONLY else ""
        found.append(f"{mark}{each.name}")
    return found


def pack(folder):
    """Pack the files of a folder, without what differs from one writing to the next."""
    with tarfile.open(HERE / "files.tar.xz", "w:xz", preset=9) as packed:
        for path in sorted(folder.rglob("*")):
            name = path.relative_to(folder)
            if path.is_dir() or path.name in INPUTS or "__pycache__" in name.parts:
                continue
            about = packed.gettarinfo(path, name.as_posix())
            about.uid = about.gid = about.mtime = 0
            about.uname = about.gname = ""
            with path.open("rb") as file:
                packed.addfile(about, file)


if __name__ == "__main__":
    with TemporaryDirectory() as made:
        for each in INPUTS:
            shutil.copyfile(HERE / each, Path(made, each))
        os.chdir(made)
        write_surface()
        if "--surface" not in sys.argv:
            write_policies()
            write_results()
            write_worlds()
            pack(Path(made))
        os.chdir(HERE)
