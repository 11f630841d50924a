"""A replay's digest, which tells damage: rerun's format has no checksum of what it holds.

It stands in the file's end as a second recording stream that is empty but for a field that rerun
passes over, and repeats the stream's footer, so that rerun finds it where it looks. Every byte of
the file is told: those before by their SHA-256, its own because they follow from the others.
"""

import hashlib
import io
import os
from pathlib import Path
from typing import BinaryIO

from swarm_mj.system.reading import open_file

HEADER_BYTES = 12  # what a stream begins with
FOOTER_BYTES, FOOTER = 32, b"RRF2FOOT\x01\x00\x00\x00"  # what it ends with, and how that ends
END = (0).to_bytes(8, "little")  # the kind of a stream's last message
FIELD = b"\xfa\x7f\x20"  # protobuf's tag of field 2047, and the length of a SHA-256
SEAL_BYTES = HEADER_BYTES + len(END) + 8 + len(FIELD) + 32 + FOOTER_BYTES
BLOCK_BYTES = 2**20


def with_digest(recorded: bytes) -> bytes:
    """A recording of rerun's, and the digest; raises OSError if rerun did not write its end."""
    if not recorded.endswith(FOOTER):
        raise OSError("rerun did not record the replay to its end")
    return recorded + _seal(io.BytesIO(recorded), len(recorded))


def has_digest(path: Path) -> bool:
    """Whether a file is a replay as it was written, to the last bit.

    Raises:
        ValueError: It is no file, or cannot be read.
        OSError: The disk fails.
    """
    with open_file(path, "replay") as file:
        num_bytes = os.fstat(file.fileno()).st_size - SEAL_BYTES
        if num_bytes < HEADER_BYTES + FOOTER_BYTES:
            return False
        seal = _seal(file, num_bytes)
        file.seek(num_bytes)
        return seal.endswith(FOOTER) and file.read(SEAL_BYTES) == seal


def _seal(file: BinaryIO | io.BytesIO, num_bytes: int) -> bytes:
    """What follows so many bytes of a replay."""
    digest = hashlib.sha256()
    file.seek(0)
    for left in range(num_bytes, 0, -BLOCK_BYTES):
        digest.update(file.read(min(left, BLOCK_BYTES)))
    file.seek(0)
    header = file.read(HEADER_BYTES)
    file.seek(max(0, num_bytes - FOOTER_BYTES))
    footer = file.read(FOOTER_BYTES)
    field = FIELD + digest.digest()
    return header + END + len(field).to_bytes(8, "little") + field + footer
