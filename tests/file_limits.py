"""Full disks without a disk."""

import resource
from contextlib import contextmanager


@contextmanager
def no_larger_files(num_bytes=0):
    """Within it, writing beyond so many bytes fails as it does on a full disk, but with EFBIG."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (num_bytes, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
