"""The folder of a run: finished shards that appear whole or not at all, and the merged tables."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from geometry import InputError
from workbench.campaign.design import n_trials
from workbench.campaign.plan import Plan
from workbench.formats.atomic import write_text

TABLES = ("trials", "frames", "timings")


@dataclass(frozen=True, eq=False)
class ShardResult:
    """What a worker gives back: Parquet bytes a table, and kept images by their path inside the run's folder."""

    shard: int
    tables: dict[str, bytes]
    images: dict[str, bytes]


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

    def save(self, result: ShardResult) -> None:
        """Put a finished shard in its place; a crash at any moment leaves it whole or absent."""
        final = self.folder / "shards" / _name(result.shard)
        try:
            for path, data in result.images.items():
                target = self.folder / path
                target.parent.mkdir(parents=True, exist_ok=True)
                _write_synced(target.with_suffix(target.suffix + ".part"), data)
                target.with_suffix(target.suffix + ".part").replace(target)
            temporary = Path(tempfile.mkdtemp(dir=self.folder / "parts"))
            for table, data in result.tables.items():
                _write_synced(temporary / f"{table}.parquet", data)
            if not final.exists():
                temporary.rename(final)
        except OSError as error:
            done = self.shards - len(self.missing())
            raise InputError(
                f"{self.folder}: shard {result.shard} can not be written ({error.strerror or error}); {done} of "
                f"{self.shards} shards are safe, make room and run the same command again"
            ) from None

    def merge(self) -> dict[str, Path]:
        """Write trials, frames and timings of all shards, in the order of the trials, as one Parquet file each."""
        out: dict[str, Path] = {}
        for table in TABLES:
            parts = [self.folder / "shards" / _name(s) / f"{table}.parquet" for s in range(self.shards)]
            out[table] = self.folder / f"{table}.parquet"
            _merge_parquet(parts, out[table])
        return out


def open_store(folder: Path, plan: Plan) -> Store:
    """Open or make the run's folder; InputError where it belongs to another plan or holds something else."""
    manifest = folder / "run.json"
    trials = n_trials(plan)
    if manifest.exists():
        _check_manifest(manifest, plan)
    elif folder.exists() and any(folder.iterdir()):
        raise InputError(f"{folder}: is not empty and holds no run.json; give an empty or new folder for this run")
    try:
        for name in ("shards", "parts"):
            (folder / name).mkdir(parents=True, exist_ok=True)
        for left in (folder / "parts").iterdir():  # what a killed run had in flight
            shutil.rmtree(left, ignore_errors=True)
    except OSError as error:
        raise InputError(f"{folder}: can not be written ({error.strerror or error})") from None
    record = {
        "fingerprint": plan.fingerprint,
        "trials": trials,
        "plan": plan.model_dump(mode="json", exclude_unset=True),
    }
    if not manifest.exists():
        write_text(manifest, json.dumps(record, indent=2, allow_nan=False) + "\n")
    return Store(folder, plan, trials)


def read_manifest(folder: Path) -> dict[str, object]:
    """The run.json of a run's folder; InputError where there is none or it is damaged."""
    path = folder / "run.json"
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{folder}: holds no run.json, so it is not the folder of a run") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: can not be read ({error})") from None
    if not isinstance(record, dict) or not {"fingerprint", "trials", "plan"} <= record.keys():
        raise InputError(f"{path}: is not the record of a run")
    return record


def _check_manifest(manifest: Path, plan: Plan) -> None:
    record = read_manifest(manifest.parent)
    if record["fingerprint"] != plan.fingerprint:
        raise InputError(
            f"{manifest.parent}: belongs to another plan, or this plan was changed since the run began; nothing was "
            "touched: give a new folder, or the plan as it was (run.json holds it)"
        )


def _name(shard: int) -> str:
    return f"{shard:06d}"


def _write_synced(path: Path, data: bytes) -> None:
    with path.open("wb") as stream:
        stream.write(data)
        stream.flush()
        os.fsync(stream.fileno())


def _merge_parquet(parts: list[Path], target: Path) -> None:
    temporary = target.with_suffix(".parquet.part")
    writer: pq.ParquetWriter | None = None
    try:
        for part in parts:
            table: pa.Table = pq.read_table(part)
            writer = writer or pq.ParquetWriter(temporary, table.schema, compression="zstd")
            writer.write_table(table)
    except OSError as error:
        raise InputError(f"{target}: can not be written ({error.strerror or error}); the shards are safe") from None
    finally:
        if writer is not None:
            writer.close()
    temporary.replace(target)
