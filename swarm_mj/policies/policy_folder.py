"""The folder of a stored policy: its weights, what they belong to, and a card for its reader."""

from collections.abc import Callable, Mapping
from pathlib import Path

from swarm_mj.io.atomic import present_folder, write_folder
from swarm_mj.io.reading import check_size, read_file

WEIGHTS, CONFIG, CARD = "model.safetensors", "config.json", "README.md"
MAX_BYTES = {WEIGHTS: 64_000_000, CONFIG: 1_000_000}
WAY_OUT = "copy it again, or make one with `swarm-mj train`"


def write_policy(
    folder: Path, contents: Mapping[str, bytes], check: Callable[[Path], object]
) -> None:
    """Writes a policy's files, whole or not at all; a policy there is replaced.

    Raises:
        ValueError: One is too large, or the folder holds other files than a policy's.
        OSError: The folder cannot be written, or does not pass the check.
    """
    for name in MAX_BYTES:
        check_size(name, len(contents[name]), MAX_BYTES[name])
    check_replaceable(folder)
    write_folder(folder, contents, check=check)


def present_policy(folder: Path) -> Path:
    """Where a policy's files are, unless a folder's name is that of something else.

    Raises:
        ValueError: It is.
    """
    present = present_folder(folder)
    if not present.exists():
        raise ValueError(
            f"policy {folder} does not exist; name a directory that `swarm-mj train` wrote, such "
            "as runs/NAME/policy"
        )
    if not present.is_dir():
        raise ValueError(f"policy {folder} is a file; name the directory that holds the policy")
    if not (present / CONFIG).exists() and (present / "policy" / CONFIG).exists():
        raise ValueError(f"{folder} is a run; name the policy in it, {folder / 'policy'}")
    return present


def read_part(folder: Path, name: str) -> bytes:
    """One of a policy's files; raises ValueError or OSError as `read_file`."""
    return read_file(folder / name, "file", MAX_BYTES[name])


def check_replaceable(folder: Path) -> None:
    """Passes if a policy may take a folder's place; what file browsers hide in it may be lost.

    Raises:
        ValueError: Something else would be lost.
    """
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"policy {folder} is a file; name another place, or remove it")
    names = {path.name for path in folder.glob("*") if not path.name.startswith(".")}
    for name in sorted(names - {WEIGHTS, CONFIG, CARD}):
        raise ValueError(f"{folder} holds {name}, which is no policy's; name another directory")
