"""Files of tensors that torch saved, read without running code from them."""

import io
import zipfile
from pathlib import Path

import torch

from swarm_mj.system.reading import read_file


def read_torch(path: Path, most_bytes: int) -> object:
    """What a checkpoint holds: tensors, numbers, strings, and lists and dicts of them.

    Raises:
        ValueError: There is no such file, or it is too large, damaged or foreign, or its folder's
            link leads elsewhere.
        OSError: It cannot be read.
    """
    content = io.BytesIO(read_file(path, "checkpoint", most_bytes, folder=path.parent))
    try:
        with zipfile.ZipFile(content) as archive:
            is_plain = all(entry.compress_type == zipfile.ZIP_STORED for entry in archive.filelist)
            if not is_plain or archive.testzip() is not None:
                raise zipfile.BadZipFile
        content.seek(0)
        return torch.load(content, map_location="cpu", weights_only=True)
    except Exception as error:  # torch names no exception of its own for damaged files
        raise ValueError(
            f"checkpoint {path} is damaged, or none; begin a new run with another --out"
        ) from error
