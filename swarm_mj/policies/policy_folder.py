"""Where a stored policy is: a folder of its weights, what they belong to, and a card; or one file.

The file is the folder's weights, with the other two in its metadata.
"""

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from swarm_mj.system.atomic import present_folder, write_folder
from swarm_mj.system.reading import check_size, format_of, read_file, read_json, read_plain

WEIGHTS, CONFIG, CARD = "model.safetensors", "config.json", "README.md"
MAX_BYTES = {WEIGHTS: 64_000_000, CONFIG: 1_000_000}
ONE_FILE = ".safetensors"
HEADER_BYTES = 8  # of such a file: how long the JSON behind them is, little-endian
MLP_FORMAT = "swarm_mj mlp policy"  # of a plain network's config; a GNN's is another
MOST_SHOWN = 8  # policies in a message
WAY_OUT = "copy it again, or make one with `swarm-mj train`"


def write_policy(
    folder: Path, contents: Mapping[str, bytes], check: Callable[[Path], object]
) -> None:
    """Write a policy's files, whole or not at all; a policy there is replaced.

    Raises:
        ValueError: One is too large, or the folder holds other files than a policy's.
        OSError: The folder cannot be written, or does not pass the check.
    """
    for name in MAX_BYTES:
        check_size(name, len(contents[name]), MAX_BYTES[name])
    check_replaceable(folder)
    write_folder(folder, contents, check=check)


def present_policy(folder: Path) -> Path:
    """Where a policy's files are, or its one file is, unless the name is that of something else.

    Raises:
        ValueError: It is.
    """
    present = present_folder(folder)
    if not present.exists():
        raise ValueError(
            f"policy {folder} does not exist; name a directory that `swarm-mj train` wrote, such "
            f"as runs/NAME/policy, or a {ONE_FILE} file"
        )
    if present.suffix == ONE_FILE and present.is_file():
        return present
    if not present.is_dir():
        raise ValueError(
            f"policy {folder} is a file; name the directory that holds the policy, or a "
            f"{ONE_FILE} file"
        )
    if not (present / CONFIG).exists():
        _check_none_below(folder)
    return present


def _check_none_below(folder: Path) -> None:
    """Raise ValueError if a folder that is no policy holds some, by themselves or in runs."""
    found = sorted(
        path.parent
        for pattern in (f"*/{CONFIG}", f"*/policy/{CONFIG}")
        for path in folder.glob(pattern)
        if (path.parent / WEIGHTS).exists()
    )
    if found == [folder / "policy"]:
        raise ValueError(f"{folder} is a run; name the policy in it, {found[0]}")
    if found:
        shown = ", ".join(map(str, found[:MOST_SHOWN]))
        more = f" and {len(found) - MOST_SHOWN} more" if len(found) > MOST_SHOWN else ""
        raise ValueError(f"{folder} holds policies; name one of them: {shown}{more}")


def read_part(folder: Path, name: str) -> bytes:
    """One of a policy's files; raises ValueError or OSError as `read_file`."""
    return read_file(folder / name, "file", MAX_BYTES[name])


def is_mlp(folder: Path) -> bool:
    """Whether a folder says that its network is no GNN, but a plain one; those have no one file.

    Raises:
        ValueError: It is no policy's folder.
        OSError: It cannot be read.
    """
    present = present_policy(folder)
    if present.is_file():
        return False
    with suppress(ValueError):  # what is wrong is said when all of it is read
        return format_of(read_part(present, CONFIG)) == MLP_FORMAT
    return False


def metadata_of(data: bytes) -> dict[str, str]:
    """Return the metadata in the JSON at the head of a safetensors file; none is empty.

    Raises:
        ValueError: It is no such file.
    """
    size = int.from_bytes(data[:HEADER_BYTES], "little")
    header = read_json(data[HEADER_BYTES : HEADER_BYTES + size], dict)
    about = read_plain(header.get("__metadata__", {}), dict)
    return {name: read_plain(text, str) for name, text in about.items()}


def check_tensors(
    expected: Mapping[str, str], tensors: Mapping[str, Any], is_finite: Callable[[Any], object]
) -> None:
    """Pass if these are a network's tensors, all of them finite.

    Args:
        expected: Each one's shape and type as `kind_of_tensor` says them, by name.
        tensors: NumPy's or torch's.
        is_finite: Whether all numbers of one are.

    Raises:
        ValueError: One is missing, unknown, of another shape or type, or not finite.
    """
    for name in sorted(expected.keys() ^ tensors.keys()):
        known = "lacks the" if name in expected else "has an unknown"
        raise ValueError(f"it {known} tensor {name:.80}")
    for name, tensor in tensors.items():
        given = kind_of_tensor(tensor.shape, tensor.dtype)
        if given != expected[name]:
            raise ValueError(f"tensor {name} must be {expected[name]}, not {given}")
        if not is_finite(tensor):
            raise ValueError(f"tensor {name} has numbers that are not finite")


def kind_of_tensor(shape: Iterable[int], dtype: object) -> str:
    """Return a tensor's shape and type, in words."""
    return f"{list(shape)} of {dtype}"


def check_replaceable(folder: Path) -> None:
    """Pass if a policy may take a folder's place; what file browsers hide in it may be lost.

    Raises:
        ValueError: Something else would be lost.
    """
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"policy {folder} is a file; name another place, or remove it")
    names = {path.name for path in folder.glob("*") if not path.name.startswith(".")}
    for name in sorted(names - {WEIGHTS, CONFIG, CARD}):
        raise ValueError(f"{folder} holds {name}, which is no policy's; name another directory")
