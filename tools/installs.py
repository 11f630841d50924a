"""Tries every install line that the documentation shows, each in an environment of its own.

    make test-installs

A line is resolved and installed as a user would have it today, with the newest versions that the
bounds allow. Then a program uses what the line promises.
"""

import argparse
import re
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
UV = ROOT / ".venv" / "bin" / "uv"
EXAMPLES = ROOT / "training" / "examples"
PAGES = ("README.md", "docs/*.md", "docs/start/*.md", "training/examples/*.py")
# An option, or a package with its extras and bounds; in quotes if a shell would read them.
WORD = r"""(?:'[^']+'|"[^"]+"|[\w.\[\],=-]+)"""
LINE = re.compile(rf"(?:uv )?pip install(?: +{WORD})+")
LONGEST_S = 900.0  # of an installation, or of a program


@dataclass(frozen=True, kw_only=True)
class Install:
    """One or more install lines of the documentation, and what they promise."""

    lines: tuple[str, ...]  # as the pages have them, in order
    program: str  # Python that ends well if the promise holds
    is_on_top: bool = False  # the page has installed swarm_mj before


def example(name: str) -> str:
    """Return a program that imports one of the examples, and so all that it needs."""
    return f"import runpy; runpy.run_path({str(EXAMPLES / name)!r}, run_name='imported')"


FLY = """
import mujoco
import swarm_mj
run = swarm_mj.fly(num_robots=10, num_windows=50, preset="urban")
run.save("flight.rrd")
print("MuJoCo", mujoco.__version__, run.summary.aoi_mean)
"""
# dm_control fails on a MuJoCo that it does not know; the message must say what helps.
FLY_AND_REFUSE = f"""{FLY}
from swarm_mj.envs.dm import make_environment
try:
    make_environment(swarm_mj.paper("flocking", num_robots=5))
except RuntimeError as error:
    assert "pip install 'swarm_mj[dm-control]'" in str(error), error
    print(error)
"""
FLY_THE_CORE = """
import sys
import swarm_mj
run = swarm_mj.fly(num_robots=10, num_windows=50, preset="urban", record=False)
assert "torch" not in sys.modules
"""
USE_DM_CONTROL = """
from swarm_mj import paper
from swarm_mj.envs.dm import make_environment
environment = make_environment(paper("flocking", num_robots=5), seed=1)
environment.reset()
environment.step(environment.action_spec().generate_value())
"""
USE_PETTINGZOO = """
from swarm_mj.envs.pettingzoo import parallel_env
parallel_env("random-walk", num_robots=5, num_windows=20).reset(seed=1)
"""
USE_SB3_CONTRIB = """
from sb3_contrib import MaskablePPO
from swarm_mj.envs.sb3 import make_vec_env
env = make_vec_env("stationary", 2, num_robots=5)
MaskablePPO("MultiInputPolicy", env, n_steps=4, batch_size=8).learn(8)
"""
USE_MINARI = """
import gymnasium, minari
minari.DataCollector(gymnasium.make("swarm_mj:swarm_mj/Stationary-v0", num_robots=5)).reset(seed=1)
"""
USE_MCAP = """
import swarm_mj
from mcap.reader import make_reader
from swarm_mj.cli import main
swarm_mj.fly(num_robots=10, num_windows=50).save("flight.rrd")
assert main(["export", "flight.rrd", "--to", "mcap"]) == 0
with open("flight.mcap", "rb") as file:
    assert make_reader(file).get_summary().statistics.message_count > 200
"""
INSTALLS = (
    Install(lines=("pip install .",), program=FLY_AND_REFUSE),
    Install(lines=("uv pip install --torch-backend cpu .",), program=FLY),
    Install(lines=("pip install --group core", "pip install --no-deps ."), program=FLY_THE_CORE),
    Install(
        lines=(
            "pip install filelock jaxtyping msgspec 'mujoco>=3.17,<5' 'numba>=0.68,<0.69' numpy "
            "packaging psutil rich scipy",
            "pip install --no-deps swarm_mj-1.1.0-py3-none-any.whl",
        ),
        program=FLY_THE_CORE,
    ),
    Install(lines=("pip install '.[dm-control]'",), program=USE_DM_CONTROL),
    Install(lines=("pip install '.[mcap]'",), program=USE_MCAP),
    Install(lines=("pip install '.[ray]'",), program="import ray, swarm_mj"),
    Install(lines=("pip install '.[slurm]'",), program="import submitit, swarm_mj"),
    Install(lines=("pip install pettingzoo",), program=USE_PETTINGZOO, is_on_top=True),
    Install(lines=("pip install sb3-contrib",), program=USE_SB3_CONTRIB, is_on_top=True),
    Install(
        lines=("pip install moviepy",),
        program="import moviepy; from gymnasium.wrappers import RecordVideo",
        is_on_top=True,
    ),
    Install(lines=('pip install "minari[all,create]"',), program=USE_MINARI, is_on_top=True),
    Install(lines=("pip install jupyterlab",), program="import jupyterlab", is_on_top=True),
    Install(
        lines=("pip install swarm_mj pettingzoo benchmarl",), program=example("benchmarl_ippo.py")
    ),
    Install(
        lines=('pip install swarm_mj pettingzoo torch "ray[rllib]" gymnasium==1.2.2',),
        program=example("rllib_ppo.py"),
    ),
    Install(lines=("pip install swarm_mj pettingzoo torchrl",), program=example("torchrl_ippo.py")),
    Install(lines=("pip install swarm_mj vmas",), program=example("vmas_link.py")),
)


def shown_lines() -> set[str]:
    """Return all install lines of the documentation and the examples."""
    found = set()
    for pattern in PAGES:
        for page in sorted(ROOT.glob(pattern)):
            for match in LINE.finditer(page.read_text()):
                found.add(match.group())
    return found


def commands(install: Install, python: Path, wheel: Path) -> Iterator[list[str]]:
    """Yield what installs the lines into the environment of `python`, with this wheel as ours."""
    into = [str(UV), "pip", "install", "--quiet", "--python", str(python)]
    ours = {"swarm_mj": str(wheel), ".": str(wheel), wheel.name: str(wheel)}
    if install.is_on_top:
        yield [*into, str(wheel)]
    for line in install.lines:
        words = []
        for word in shlex.split(line.partition("pip install ")[2]):
            extra = re.fullmatch(r"\.(\[.+\])", word)
            words.append(f"{wheel}{extra.group(1)}" if extra else ours.get(word, word))
        yield [*into, *words]


def attempt(install: Install, wheel: Path) -> str:
    """Install the lines and run the program; return the last line of the first that failed."""
    with tempfile.TemporaryDirectory() as folder:
        python = Path(folder) / "env" / "bin" / "python"
        steps = [[str(UV), "venv", "--quiet", "--python", sys.executable, str(python.parents[1])]]
        steps += commands(install, python, wheel)
        steps.append([str(python), "-P", "-c", install.program])
        said = ""
        for step in steps:
            # `--group` reads the pyproject.toml of the folder it runs in.
            place = ROOT if "--group" in step else Path(folder)
            done = subprocess.run(
                step, cwd=place, capture_output=True, text=True, timeout=LONGEST_S, check=False
            )
            said = (done.stderr + done.stdout).strip()
            if done.returncode != 0:
                return said or f"exit code {done.returncode}"
        print(*(f"  {line}" for line in said.splitlines()[-2:]), sep="\n")
    return ""


def main() -> None:
    """Try all lines, or those that hold a text; exit with how many failed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", default="", help="try the lines that hold this text")
    only = parser.parse_args().only
    num_failed = 0
    with tempfile.TemporaryDirectory() as dist:
        build = [sys.executable, "-m", "build", "--no-isolation", "--wheel", "--outdir", dist, ROOT]
        subprocess.run(build, check=True, capture_output=True)
        (wheel,) = Path(dist).glob("*.whl")
        for install in INSTALLS:
            shown = "; ".join(install.lines)
            if only not in shown:
                continue
            print(shown, flush=True)
            begun_s = time.monotonic()
            failure = attempt(install, wheel)
            took_s = time.monotonic() - begun_s
            outcome = "FAILED" if failure else "works"
            print(f"  {outcome}, {took_s:.0f} s", flush=True)
            if failure:
                print(failure[-1000:])
            num_failed += bool(failure)
    sys.exit(num_failed)


if __name__ == "__main__":
    main()
