"""The tables of all shards as one Parquet file each, streamed: never more in memory than one group of rows."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from geometry import InputError
from workbench.campaign.store.rows import PARQUET

TABLES = ("trials", "frames", "timings")
GROUP_ROWS = 20_000  # rows of a Parquet group: some megabytes in memory, as benchmarks/campaign_memory.py shows
DAMAGED = (pa.ArrowException, OSError)  # how pyarrow speaks of a file that is not what was written


def merge_tables(parts: Iterable[Path], target: Path, scratch: Path) -> None:
    """Write the rows of ``parts``, in their order, to ``target``, which appears whole or not at all.

    scratch: a folder beside it. InputError where a part is damaged or the disk is full.
    """
    temporary = scratch / f"{target.name}.part"
    writer: pq.ParquetWriter | None = None
    try:
        for group in _groups(parts):
            writer = writer or pq.ParquetWriter(temporary, group.schema, **PARQUET)
            writer.write_table(group)
        if writer is not None:
            writer.close()
            temporary.replace(target)
    except OSError as error:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise InputError(
            f"{target}: can not be written ({error.strerror or error}); all shards are safe, make room and run the "
            "same command again"
        ) from None
    finally:
        if writer is not None and writer.is_open:
            with contextlib.suppress(OSError, pa.ArrowException):
                writer.close()


def _groups(parts: Iterable[Path]) -> Iterator[pa.Table]:
    """Tables of at least GROUP_ROWS rows, and what is left."""
    waiting: list[pa.Table] = []
    for part in parts:
        waiting.append(_read(part))
        if sum(t.num_rows for t in waiting) >= GROUP_ROWS:
            yield pa.concat_tables(waiting)
            waiting = []
    if waiting:
        yield pa.concat_tables(waiting)


def damaged(shard: Path) -> str:
    """The sentence about a finished shard that can not be read."""
    return f"{shard}: this finished shard is damaged; take the folder away and run the same command again to redo it"


def _read(part: Path) -> pa.Table:
    try:
        return pq.read_table(part, page_checksum_verification=True)
    except DAMAGED as error:
        raise InputError(f"{damaged(part.parent)} ({error})") from None
