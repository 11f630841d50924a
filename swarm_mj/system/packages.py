"""Files that this package brings, and the packages that it needs: how to get one that is missing.

A plain `pip install swarm_mj` brings them all; its core, which flies, does without most.
"""

from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

# What flying imports; `pyproject.toml` has their versions under the same name.
CORE = ("jaxtyping", "msgspec", "mujoco", "numba", "numpy", "packaging", "psutil", "rich")
# Modules that are named otherwise than the packages that bring them.
BROUGHT_BY = {"PIL": "pillow", "dm_control": "dm-control", "rerun": "rerun-sdk"}


def asset(name: str) -> Path:
    """Return a file or folder of `assets/`, in a checkout or in an installed wheel."""
    package = Path(__file__).parents[1]
    for folder in (package / "assets", package.parent / "assets"):
        if (folder / name).exists():
            return folder / name
    raise FileNotFoundError(f"asset {name} is neither in the package nor beside it; reinstall")


def need(module: str, what: str, way_out: str = "") -> None:
    """Raise ModuleNotFoundError unless a module can be imported; arguments as of `missing`."""
    if not is_installed(module):
        raise ModuleNotFoundError(missing(module, what, way_out), name=module)


def missing(module: str, what: str, way_out: str = "") -> str:
    """Return how to install a module that `what` needs, or how to do without it: the way out."""
    package = BROUGHT_BY.get(module, module.replace("_", "-"))
    instead = f", or {way_out}" if way_out else ""
    return (
        f"{what} needs {package}, which is not installed; pip install '{_wanted(package)}'{instead}"
    )


def is_installed(module: str) -> bool:
    """Return whether a module, by its name as it is imported, can be."""
    return find_spec(module) is not None


def _wanted(package: str) -> str:
    """Return a package with the versions that fit, as pip takes it; without, if none are known."""
    from packaging.requirements import Requirement

    try:
        wanted = [Requirement(text) for text in metadata.requires("swarm_mj") or ()]
    except metadata.PackageNotFoundError:  # a checkout that was never installed
        wanted = []
    fitting = (each for each in wanted if each.name == package)
    return next((f"{each.name}{each.specifier}" for each in fitting), package)
