"""The installed package: its files, version and commit, and the packages that it needs.

A plain `pip install swarm_mj` brings them all; its core, which flies, does without most.
"""

import hashlib
import subprocess
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

# What flying imports; `pyproject.toml` has their versions under the same name.
CORE = (
    "filelock",
    "jaxtyping",
    "msgspec",
    "mujoco",
    "numba",
    "numpy",
    "packaging",
    "psutil",
    "rich",
    "scipy",
)
# Modules that are named otherwise than the packages that bring them.
BROUGHT_BY = {
    "PIL": "pillow",
    "dm_control": "dm-control",
    "mcap_protobuf": "mcap-protobuf-support",
    "rerun": "rerun-sdk",
}
# What numbers depend on; what is drawn from them is no change to them.
SOURCES = ("swarm_mj", "assets", ":!assets/figures", ":!assets/pictures", "pyproject.toml")


def asset(name: str) -> Path:
    """Return a file or folder of `assets/`, in a checkout or in an installed wheel."""
    package = Path(__file__).parents[1]
    for folder in (package / "assets", package.parent / "assets"):
        if (folder / name).exists():
            return folder / name
    raise FileNotFoundError(f"asset {name} is neither in the package nor beside it; reinstall")


def version() -> str:
    """Return the installed package's version."""
    return metadata.version("swarm_mj")


def code_digest() -> str:
    """Return a hash of the package's code and data, which changes before a commit, too."""
    package = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    kinds = (".py", ".csv", ".toml")
    for path in sorted(path for path in package.rglob("*") if path.suffix in kinds):
        digest.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def commit() -> str | None:
    """Return the commit of the code, with `+` if the package differs; None if it is not known.

    It is the checkout's, or that which `tools/store_commit.py` stored when the package was built.
    """
    package = Path(__file__).resolve().parents[1]
    checkout = package.parent
    if not (checkout / ".git").exists():
        stored = package / "COMMIT"
        return stored.read_text(encoding="utf-8").strip() if stored.exists() else None

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(checkout), *arguments]
        done = subprocess.run(command, capture_output=True, check=True, encoding="utf-8")
        return done.stdout.strip()

    try:
        head = git("rev-parse", "--short=12", "HEAD")
        return f"{head}+" if git("status", "--porcelain", "--", *SOURCES) else head
    except (OSError, subprocess.CalledProcessError):
        return None


def is_installed(module: str) -> bool:
    """Return whether a module, by its name as it is imported, can be."""
    return find_spec(module) is not None


def need(module: str, what: str, way_out: str = "") -> None:
    """Raise ModuleNotFoundError unless a module can be imported; arguments as of `missing`."""
    if not is_installed(module):
        raise ModuleNotFoundError(missing(module, what, way_out), name=module)


def missing(module: str, what: str, way_out: str = "") -> str:
    """Return how to install a module that `what` needs, or how to do without it: the way out."""
    from packaging.requirements import Requirement

    package = BROUGHT_BY.get(module, module.replace("_", "-"))
    try:
        wanted = [Requirement(text) for text in metadata.requires("swarm_mj") or ()]
    except metadata.PackageNotFoundError:  # a checkout that was never installed
        wanted = []
    versions = next((str(each.specifier) for each in wanted if each.name == package), "")
    way = f"pip install '{package}{versions}'" + (f", or {way_out}" if way_out else "")
    return f"{what} needs {package}, which is not installed; {way}"
