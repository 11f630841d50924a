"""Files that the package brings: MJCF and policies."""

from importlib import resources
from pathlib import Path


def asset(name: str) -> Path:
    """Return the path of a file or folder in `assets/`, in a checkout or in an installed wheel.

    Raises:
        FileNotFoundError: It is in neither place.
    """
    package = Path(str(resources.files("swarm_mj")))
    for folder in (package / "assets", package.parent / "assets"):
        if (folder / name).exists():
            return folder / name
    raise FileNotFoundError(f"asset {name} is neither in the package nor beside it; reinstall")
