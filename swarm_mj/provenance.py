"""Which code made a number: the package's version and, in a checkout, its commit."""

import subprocess
from importlib import metadata
from pathlib import Path


def version() -> str:
    """The installed package's version."""
    return metadata.version("swarm_mj")


def commit() -> str | None:
    """The checkout's commit, with `+` when files differ from it; None outside a checkout."""
    checkout = Path(__file__).resolve().parent.parent
    if not (checkout / ".git").exists():
        return None
    try:
        head = _git(checkout, "rev-parse", "--short=12", "HEAD")
        return f"{head}+" if _git(checkout, "status", "--porcelain") else head
    except (OSError, subprocess.CalledProcessError):
        return None


def _git(checkout: Path, *arguments: str) -> str:
    command = ["git", "-C", str(checkout), *arguments]
    return subprocess.run(command, capture_output=True, check=True, text=True).stdout.strip()
