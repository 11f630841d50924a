"""Small programs that try something out, each in a process of its own, as it may crash.

MuJoCo chooses how to render once in a process, so each way needs one of its own anyway.
"""

import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from subprocess import Popen, TimeoutExpired
from textwrap import shorten
from typing import IO, NamedTuple

from swarm_mj.cli.health.finding import Finding
from swarm_mj.system.processes import PYTHON, running

LONGEST_S = 120.0  # of a trial; the first flight of an installation compiles for half a minute
MOST_LETTERS = 400  # of what a trial complains, cut between words

RENDER = """
import mujoco
model = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><light pos='0 0 3'/><geom size='1'/></worldbody></mujoco>")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 32, 32) as renderer:
    renderer.update_scene(data)
    assert renderer.render().any(), "the picture is black"
print("works")
"""
# vkCreateInstance and vkEnumeratePhysicalDevices; 1 is the type of the first's argument.
VULKAN = """
import ctypes
class Info(ctypes.Structure):
    _fields_ = [("type", ctypes.c_int), ("next", ctypes.c_void_p), ("flags", ctypes.c_uint32),
                ("application", ctypes.c_void_p), ("num_layers", ctypes.c_uint32),
                ("layers", ctypes.c_void_p), ("num_extensions", ctypes.c_uint32),
                ("extensions", ctypes.c_void_p)]
vulkan = ctypes.CDLL("libvulkan.so.1")
instance, number = ctypes.c_void_p(), ctypes.c_uint32()
assert vulkan.vkCreateInstance(ctypes.byref(Info(type=1)), None, ctypes.byref(instance)) == 0, \
    "no instance"
vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(number), None)
assert number.value, "no device"
print("devices:", number.value)
"""
TORCH = """
import torch
print(f"threads: {torch.get_num_threads()}, CUDA devices: {torch.cuda.device_count()}")
"""
FLIGHT = (
    *("-m", "swarm_mj", "fly", "--task", "stationary", "--policy", "tdma", "--robots", "3"),
    *("--windows", "5", "--range-ratio", "10", "--no-record"),
)


class Trial(NamedTuple):
    """A program that ends with 0 if the thing works, and then says of it what it prints last."""

    group: str
    name: str
    arguments: tuple[str, ...]  # of Python
    mend: str
    variables: Mapping[str, str] = {}
    is_needed: bool = False
    works: str = ""  # what to say in place of what it prints


RENDERING = "rendering without a display"
TRIALS = (
    Trial(
        "flying",
        "three robots fly",
        FLIGHT,
        "see what `swarm-mj fly --robots 3` says; if a package is broken, mend it first",
        is_needed=True,
        works="yes",
    ),
    *(
        Trial(RENDERING, f"MUJOCO_GL={back_end}", ("-c", RENDER), mend, {"MUJOCO_GL": back_end})
        for back_end, mend in {
            "egl": "needs a graphics driver with EGL, such as NVIDIA's; or use osmesa",
            "osmesa": "Debian and Ubuntu: apt-get install libosmesa6",
            "glfw": "needs a display; without one use egl or osmesa",
        }.items()
    ),
    Trial(
        "rerun's viewer",
        "Vulkan",
        ("-c", VULKAN),
        "for tools/picture.py; Debian and Ubuntu: apt-get install mesa-vulkan-drivers",
    ),
    Trial("speed", "torch", ("-c", TORCH), "learned policies and training need it"),
)


def tried() -> Iterator[Finding]:
    """What came of the trials, which run side by side."""
    with ExitStack() as stack:
        under_way = []
        for trial in TRIALS:
            said = stack.enter_context(tempfile.TemporaryFile("w+"))
            command = [*PYTHON, *trial.arguments]
            environment = os.environ | trial.variables
            process = running(command, environment=environment, output=said)
            under_way.append((trial, stack.enter_context(process), said))
        for trial, process, said in under_way:
            yield _outcome(trial, process, said)


def _outcome(trial: Trial, process: "Popen[bytes]", said: IO[str]) -> Finding:
    try:
        code = process.wait(LONGEST_S)
    except TimeoutExpired:
        code = None
    said.seek(0)
    last = (said.read().strip().splitlines() or ["it said nothing"])[-1]
    last = shorten(last, MOST_LETTERS, placeholder=" ...")
    if code == 0:
        return Finding(trial.group, trial.name, "ok", trial.works or last)
    found = f"not within {LONGEST_S:g} s" if code is None else last
    state = "broken" if trial.is_needed else "absent"
    return Finding(trial.group, trial.name, state, found, trial.mend)
