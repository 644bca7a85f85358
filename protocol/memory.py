"""Keep freed memory for the next observation.

The C library hands large blocks back to the kernel as soon as they are free and has to fetch them
again, page by page, for the next message: 400 page faults and more than half of the processor time
of a request. glibc raises its thresholds (to twice this size) when a large block has come and gone
once; elsewhere the call does nothing.
"""

from __future__ import annotations

_LARGEST = 31 * 2**20  # glibc learns from blocks up to 32 MiB


def keep_freed_memory() -> None:
    """Make this process keep up to about 64 MiB of freed memory. Costs nothing: no page of the
    block is ever touched."""
    bytearray(_LARGEST)
