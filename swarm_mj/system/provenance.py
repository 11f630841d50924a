"""Which code made a number: the package's version and, in a checkout, its commit."""

import hashlib
import subprocess
from importlib import metadata
from pathlib import Path

# What numbers depend on; what is drawn from them is no change to them.
PACKAGE = ("swarm_mj", "assets", ":!assets/figures", ":!assets/pictures", "pyproject.toml")


def version() -> str:
    """Return the installed package's version."""
    return metadata.version("swarm_mj")


def code_digest() -> str:
    """Return a hash of the package's code and data, which tells changes that no commit tells."""
    package = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    for path in sorted([*package.rglob("*.py"), *package.rglob("*.csv")]):
        digest.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def commit() -> str | None:
    """Return the checkout's commit, with `+` if the package differs; None outside a checkout."""
    checkout = Path(__file__).resolve().parents[2]
    if not (checkout / ".git").exists():
        return None
    try:
        head = _git(checkout, "rev-parse", "--short=12", "HEAD")
        return f"{head}+" if _git(checkout, "status", "--porcelain", "--", *PACKAGE) else head
    except (OSError, subprocess.CalledProcessError):
        return None


def _git(checkout: Path, *arguments: str) -> str:
    command = ["git", "-C", str(checkout), *arguments]
    return subprocess.run(command, capture_output=True, check=True, encoding="utf-8").stdout.strip()
