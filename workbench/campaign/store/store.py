"""The folder of a run: finished shards that appear whole or not at all, and the merged tables."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pyarrow.parquet as pq

from geometry import InputError
from workbench.campaign.asked.plan import Plan
from workbench.campaign.asked.trials import n_trials
from workbench.campaign.store.environment import note_environment
from workbench.campaign.store.files import locked, sync_folder, write_synced
from workbench.campaign.store.manifest import LOCK, check_manifest, is_ours, write_manifest
from workbench.campaign.store.merge import DAMAGED, TABLES, damaged, merge_tables


@dataclass(frozen=True, eq=False)
class ShardResult:
    """What a worker gives back: Parquet bytes a table, and kept images by their path inside the run's folder.

    environment: the numeric one in which they were computed.
    """

    shard: int
    tables: dict[str, bytes]
    images: dict[str, bytes]
    environment: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Store:
    """An opened run folder of one plan."""

    folder: Path
    plan: Plan
    trials: int

    @property
    def shards(self) -> int:
        """The number of shards of the plan, fixed by the plan alone."""
        return -(-self.trials // self.plan.shard_trials)

    def trials_of(self, shard: int) -> range:
        """Trial numbers of a shard."""
        start = shard * self.plan.shard_trials
        return range(start, min(start + self.plan.shard_trials, self.trials))

    def missing(self) -> list[int]:
        """Shards that are not there yet, in order."""
        done = {p.name for p in (self.folder / "shards").iterdir() if p.is_dir()}
        return [s for s in range(self.shards) if _name(s) not in done]

    def check(self) -> None:
        """InputError where a finished shard is not what was written: found before hours are spent, not at their end."""
        missing = set(self.missing())
        for shard in (s for s in range(self.shards) if s not in missing):
            folder = self.path_of(shard, TABLES[0]).parent
            try:
                rows = {t: pq.read_metadata(self.path_of(shard, t)).num_rows for t in TABLES}
            except DAMAGED as error:
                raise InputError(f"{damaged(folder)} ({error})") from None
            if rows["trials"] != len(self.trials_of(shard)):
                raise InputError(f"{damaged(folder)} ({rows['trials']} rows, not {len(self.trials_of(shard))})")

    def save(self, result: ShardResult) -> None:
        """Put a finished shard in its place; a crash at any moment leaves it whole or absent."""
        final = self.folder / "shards" / _name(result.shard)
        try:
            for path, data in result.images.items():
                target = self.folder / path
                part = target.with_suffix(target.suffix + ".part")
                target.parent.mkdir(parents=True, exist_ok=True)
                write_synced(part, data)
                part.replace(target)
            note_environment(self.folder, result.environment)
            temporary = Path(tempfile.mkdtemp(dir=self.folder / "parts"))
            for table, data in result.tables.items():
                write_synced(temporary / f"{table}.parquet", data)
            if final.exists():
                shutil.rmtree(temporary)
                return
            temporary.rename(final)
            sync_folder(final.parent)
        except OSError as error:
            done = self.shards - len(self.missing())
            raise InputError(
                f"{self.folder}: shard {result.shard} can not be written ({error.strerror or error}); {done} of "
                f"{self.shards} shards are safe, make room and run the same command again"
            ) from None

    def path_of(self, shard: int, table: str) -> Path:
        """Where a shard's table lies."""
        return self.folder / "shards" / _name(shard) / f"{table}.parquet"

    def merge(self) -> None:
        """Write trials, frames and timings of all shards, in the order of the trials, as one Parquet file each."""
        for table in TABLES:
            parts = (self.path_of(s, table) for s in range(self.shards))
            merge_tables(parts, self.folder / f"{table}.parquet", self.folder / "parts")


@contextmanager
def opened_store(folder: Path, plan: Plan) -> Iterator[Store]:
    """Open or make the run's folder, for one process at a time.

    InputError where it belongs to another plan, holds something else or a damaged shard, or is in use.
    """
    manifest = folder / "run.json"
    if not manifest.exists() and folder.exists() and not (folder.is_dir() and all(map(is_ours, folder.iterdir()))):
        raise InputError(f"{folder}: is not an empty folder and holds no run.json; give an empty or new one")
    trials = n_trials(plan)
    if manifest.exists():
        check_manifest(folder, plan)
    in_use = f"{folder}: another sweep runs in this folder; wait for it or give another folder"
    with ExitStack() as held:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            held.enter_context(locked(folder / LOCK, in_use))
            store = _ready(folder, plan, trials)
        except OSError as error:
            raise InputError(f"{folder}: can not be written ({error.strerror or error})") from None
        yield store


def _ready(folder: Path, plan: Plan, trials: int) -> Store:
    """The folder's tables cleared of what a killed run had in flight."""
    write_manifest(folder, plan, trials)
    for name in ("shards", "parts"):
        (folder / name).mkdir(exist_ok=True)
    for left in (folder / "parts").iterdir():
        shutil.rmtree(left) if left.is_dir() else left.unlink()
    for left in (folder / "images").rglob("*.part") if (folder / "images").exists() else ():
        left.unlink()
    store = Store(folder, plan, trials)
    store.check()
    return store


def _name(shard: int) -> str:
    return f"{shard:06d}"
