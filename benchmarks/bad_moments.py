"""Every command at bad moments: killed or interrupted, on a full disk, where it may not write, short of memory, twice.

A fault of a kill is another exit code than 130 after Ctrl-C, a traceback, a file under its own name that the
undisturbed run does not know so, a process that lives on, a second run that refuses or gives other bytes.
Most commands are forked from a process that has the modules in memory, so that nearly all of their time is work;
one in five is started as a user starts it, so that the moment may fall into imports. Moments are counted in the
command's own processor time where it is one process, so that a busy machine changes nothing. In a corner it has to
answer or to say one sentence, with nothing half written, and once out of it to give what it always gives.
Run: PYTHONPATH=. python benchmarks/bad_moments.py [kills, default 30] [seed] [0: no corners]; `bad_files.py` runs them,
too.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
STARTED = 0.2  # share of the kills that start a fresh interpreter
FULL_BYTES = 3000  # of a file: all but the smallest meet a full disk
LITTLE_BYTES = (8 * 2**20, 60 * 2**20)  # of memory beyond what the modules take
LIVES_ON_S = 15.0  # after which a process of a command that has ended is a fault
ENDLESS_S = 3.0  # a window or a watch is ended within so long
PACKAGES = ("geometry", "jig_cad", "perceptron_emu", "extraction", "calib", "workbench")
PRELOADED = (
    "cv2", "dask", "distributed", "joblib", "matplotlib.figure", "matplotlib.backends.backend_agg",
    "matplotlib.backends.backend_svg", "numba", "optuna", "pyarrow.parquet", "pandas", "scipy.optimize",
    "scipy.spatial", "skimage.measure", "trimesh", "jinja2", "bokeh.plotting", "panel", "scipy.stats",
    "pydantic", "rich.progress",
)  # fmt: skip


@dataclass(frozen=True)
class Command:
    """words: OUT stands for the run's folder. grows: names of files that may stand there half finished, by intent.

    aside: it works in processes of its own, so that moments are of the wall's time. endless: a window or a watch.
    """

    words: tuple[str, ...]
    grows: str = r"(?!)"
    aside: bool = False
    endless: bool = False
    cpu_s: float = 0.0
    wall_s: float = 0.0


@dataclass(frozen=True)
class Ended:
    """How a command ended: its code, or the negative signal; what it said; what it cost."""

    code: int
    text: str
    cpu_s: float
    wall_s: float


@dataclass(frozen=True)
class Undisturbed:
    """All commands and what each leaves and says when nothing is wrong; an endless one leaves nothing."""

    folder: Path
    commands: dict[str, Command]
    whole: dict[str, tuple[dict[str, str], Ended]]
    faults: list[str]


def undisturbed(folder: Path) -> Undisturbed:
    """Make the input in a folder and run every command once."""
    folder = folder / "moments"
    folder.mkdir()
    commands = all_commands(folder)
    runner = Runner(folder)
    whole: dict[str, tuple[dict[str, str], Ended]] = {}
    faults: list[str] = []
    for name, command in commands.items():
        if command.endless:
            continue
        out = folder / "whole" / name
        out.mkdir(parents=True)
        ended = runner.run(_words(command, out))
        if ended.code not in (0, 1, 3):
            faults.append(f"{name}: undisturbed it ends with {ended.code}, {ended.text[-300:]!r}")
        commands[name] = replace(command, cpu_s=ended.cpu_s, wall_s=ended.wall_s)
        whole[name] = digest(out), ended
    runner.close()
    return Undisturbed(folder, commands, whole, faults)


def kill(known: Undisturbed, count: int, seed: int) -> list[str]:
    """Kill ``count`` times over all commands, the dear ones least often; print the counts; the faults."""
    commands, folder = known.commands, known.folder
    runner = Runner(folder)
    faults: list[str] = []
    counts: Counter[str] = Counter()
    drawn = _shares(commands, count)
    rng = np.random.default_rng([seed, 1])
    rng.shuffle(drawn)
    start = time.perf_counter()
    for i, name in enumerate(drawn):
        found, how = _killed(runner, commands[name], known.whole.get(name), folder / f"killed{i}", rng)
        faults += [f"kill {i}, seed {seed}, {name}, {how}: {fault}" for fault in found]
        for fault in found:
            print(f"  kill {i}, {name}, {how}: {fault}", flush=True)
        counts[f"{name} {'done before' if how == 'done before' else 'killed'}"] += 1
        if i % 50 == 49:
            print(f"  {i + 1} of {len(drawn)} kills, {time.perf_counter() - start:.0f} s", flush=True)
    runner.close()
    print(f"{len(drawn)} kills of {len(commands)} commands, {len(faults)} faults: ", end="")
    print(", ".join(f"{n} {what}" for what, n in sorted(counts.items())), flush=True)
    return faults


def corner(known: Undisturbed) -> list[str]:
    """Each command on a full disk, where nobody may write, short of memory, and twice at once; the faults."""
    runner, second = Runner(known.folder), Runner(known.folder, "second")
    locked = Path("/sys/kernel") if os.geteuid() == 0 else known.folder / "locked"  # root may write against rights
    if os.geteuid() != 0:
        locked.mkdir()
        locked.chmod(0o555)
    limits = {"full disk": {"file_bytes": FULL_BYTES}} | {
        f"{more / 2**20:.0f} MiB of memory": {"more_bytes": more} for more in LITTLE_BYTES
    }
    faults: list[str] = []
    counts: Counter[str] = Counter()
    for name, command in known.commands.items():
        if command.endless:
            continue
        files, ended = known.whole[name]
        found: list[tuple[str, str]] = []
        for what, limit in limits.items():
            out = known.folder / f"{what}, {name}"
            out.mkdir()
            cornered = runner.run(_words(command, out), limits=limit)
            found += [(what, t) for t in _sentence(cornered)]
            found += [(what, t) for t in _halves(out, files, command.grows)]
            found += [(what, f"{p} is left") for p in out.rglob("*.part")]
            counts[f"{what}: {'answered' if cornered.code == ended.code else 'a sentence'}"] += 1
            if files and cornered.code != ended.code:
                found += [
                    (what, t) for t in _second(runner.run(_words(command, out)), out, command.words, (files, ended))
                ]
            shutil.rmtree(out)
        if files:
            cornered = runner.run(_words(command, locked / "out"))
            found += [("read-only", t) for t in _sentence(cornered)]
            found += [("read-only", "it ends with 0")] if cornered.code == 0 else []
            out = known.folder / f"twice, {name}"
            out.mkdir()
            with ThreadPoolExecutor(2) as pool:
                both = list(pool.map(Runner.run, (runner, second), (_words(command, out),) * 2))
            found += [("two at once", t) for e in both for t in _sentence(e)]
            found += [
                ("two at once", t)
                for t in _second(runner.run(_words(command, out)), out, command.words, (files, ended))
            ]
            counts.update(["read-only", "two at once"])
            shutil.rmtree(out)
        faults += [f"{what}, {name}: {text}" for what, text in found]
        for what, text in found:
            print(f"  {what}, {name}: {text}", flush=True)
    runner.close()
    second.close()
    print(
        f"corners, {len(faults)} faults: " + ", ".join(f"{n} {what}" for what, n in sorted(counts.items())), flush=True
    )
    return faults


def _sentence(ended: Ended) -> list[str]:
    """What is wrong with how a cornered command ended."""
    if ended.code in (0, 1, 3):
        return []
    said = [line for line in ended.text.splitlines() if "error:" in line]
    whole = ended.code == 2 and len(said) == 1 and "Traceback" not in ended.text
    return [] if whole else [f"code {ended.code}, {ended.text[-400:]!r}"]


def _shares(commands: dict[str, Command], count: int) -> list[str]:
    """Names, so often that no command takes much more time than another, and each at least once."""
    cost = np.array([max(c.cpu_s, 0.3) for c in commands.values()])
    share = np.minimum(1 / cost, 8 * np.min(1 / cost))
    exact = share / share.sum() * max(count - len(commands), 0)
    each = 1 + np.floor(exact).astype(int)
    for k in np.argsort(exact - np.floor(exact))[::-1][: max(count - int(each.sum()), 0)]:
        each[k] += 1
    return [name for name, n in zip(commands, each, strict=True) for _ in range(n)][: max(count, len(commands))]


def _killed(
    runner: Runner, command: Command, whole: tuple[dict[str, str], Ended] | None, out: Path, rng: np.random.Generator
) -> tuple[list[str], str]:
    """What is wrong after one kill, and how it was killed."""
    out.mkdir()
    words = _words(command, out)
    hard, alone, fresh = (bool(v) for v in rng.random(3) < (0.5, 0.3, STARTED))
    share = float(rng.random())
    aside = command.aside or command.endless or fresh
    length = ENDLESS_S if command.endless else (command.wall_s if aside else command.cpu_s) + (1.5 if fresh else 0.0)
    moment = share * length
    ended = runner.run(words, moment, wall=aside, hard=hard, alone=hard and alone, fresh=fresh)
    signalled = "SIGKILL" if hard else "SIGINT"
    how = f"{signalled}{' alone' if hard and alone else ''} after {moment:.2f} s{', fresh' if fresh else ''}"
    expected = (
        {0, 1, 3, -signal.SIGKILL}
        if hard
        else {0, 1, 3, 130, *((-signal.SIGINT,) if fresh and "in main" not in ended.text else ())}
    )
    found = []
    # while the interpreter itself starts nobody can look after it
    before_us = fresh and ended.code in (1, -signal.SIGINT) and "in main" not in ended.text
    if ended.code not in expected or ("Traceback" in ended.text and not before_us):
        found.append(f"code {ended.code}, {ended.text[-400:]!r}")
    if whole is not None:
        found += _halves(out, whole[0], command.grows)
        if not hard:
            found += [f"{p} is left" for p in out.rglob("*.part")]
        if any("OUT" in word for word in command.words):  # else nothing is left that could stand in the way
            found += _second(runner.run(words), out, words, whole)
    if alive := runner.living():
        found.append(f"processes live on: {alive}")
    shutil.rmtree(out, ignore_errors=True)
    return found, "done before" if ended.code in (0, 1, 3) and not command.endless else how


def _halves(out: Path, whole: dict[str, str], grows: str) -> list[str]:
    """Files that stand there under their own name, and are not what an undisturbed run leaves."""
    left = digest(out)
    return [
        f"{n} is {'not known' if n not in whole else 'no whole file'} after the kill"
        for n in left
        if left[n] != whole.get(n) and not re.search(grows, n)
    ][:3]


def _second(again: Ended, out: Path, words: Sequence[str], whole: tuple[dict[str, str], Ended]) -> list[str]:
    """What is wrong with the second run."""
    files, undisturbed = whole
    made = digest(out)
    if words[0] == "init" and again.code == 2 and made == files:
        return []  # it had ended: nothing is left to do
    if again.code != undisturbed.code:
        return [f"run again it ends with {again.code}, {again.text[-300:]!r}"]
    if made != files:
        other = sorted(n for n in {*made, *files} if made.get(n) != files.get(n))
        return [f"run again it gives other bytes: {', '.join(other[:6])}"]
    return []


def _words(command: Command, out: Path) -> list[str]:
    return [w.replace("OUT", str(out)) for w in command.words]


def digest(folder: Path) -> dict[str, str]:
    """By name the content of what a run leaves; times and places of the run do not count."""
    return dict(sorted(_digests(folder)))


def _digests(folder: Path) -> Iterator[tuple[str, str]]:
    for path in folder.rglob("*"):
        name = str(path.relative_to(folder))
        if (
            path.is_file()
            and path.suffix not in (".part", ".journal")
            and "timings" not in name
            and "shards" not in name
        ):
            if path.name in ("run.lock", "environment.json"):
                continue
            content = path.read_bytes().replace(str(folder).encode(), b"OUT")
            yield name, hashlib.sha256(content).hexdigest()


class Runner:
    """Runs commands, forked from a process with all modules or freshly started, and kills them when asked."""

    def __init__(self, folder: Path, name: str = "said") -> None:
        self.log = folder / f"{name}.txt"
        self.sessions: list[int] = []
        self.server = subprocess.Popen(  # noqa: S603 - our own code
            [sys.executable, str(Path(__file__).resolve()), "--serve"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment(),
            start_new_session=True,
        )
        assert self._answer() == "ready"

    def close(self) -> None:
        """End the process that is forked."""
        self.server.stdin.close()  # type: ignore[union-attr]
        self.server.wait()

    def _answer(self) -> str:
        return self.server.stdout.readline().strip()  # type: ignore[union-attr]

    def run(
        self, words: list[str], moment: float | None = None, *, wall: bool = False, hard: bool = False,
        alone: bool = False, fresh: bool = False, limits: dict[str, int] | None = None,
    ) -> Ended:  # fmt: skip
        """Run a command to its end, or for ``moment`` seconds, then kill it; ``limits`` hold for forked ones."""
        start = time.perf_counter()
        started = None
        if fresh:
            with self.log.open("w") as log:
                started = subprocess.Popen(  # noqa: S603 - our own command
                    [sys.executable, "-m", "workbench", *words], stdout=log, stderr=log, env=environment(),
                    stdin=subprocess.DEVNULL, start_new_session=True,
                )  # fmt: skip
            pid = started.pid
        else:
            self.server.stdin.write(json.dumps({"words": words, "log": str(self.log)} | (limits or {})) + "\n")  # type: ignore[union-attr]
            self.server.stdin.flush()  # type: ignore[union-attr]
            pid = int(self._answer())
        self.sessions.append(pid)
        if moment is not None:
            while _runs(pid) and (time.perf_counter() - start if wall else _cpu_s(pid)) < moment:
                time.sleep(0.001)
            with contextlib.suppress(ProcessLookupError):
                (os.kill if alone else os.killpg)(pid, signal.SIGKILL if hard else signal.SIGINT)
        if started is not None:
            status, cpu = started.wait(), 0.0
        else:
            self.server.stdin.write("wait\n")  # type: ignore[union-attr]
            self.server.stdin.flush()  # type: ignore[union-attr]
            status, cpu = json.loads(self._answer())
        return Ended(status, self.log.read_text(errors="replace"), cpu, time.perf_counter() - start)

    def living(self) -> list[str]:
        """Processes of ended commands that are still there after a while; they are ended."""
        until = time.perf_counter() + LIVES_ON_S
        while (found := [p for p in _processes() if p[1] in self.sessions]) and time.perf_counter() < until:
            time.sleep(0.05)
        for pid, _, _ in found:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.sessions.clear()
        return [f"{pid} {name}" for pid, _, name in found]


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def _cpu_s(pid: int) -> float:
    try:
        return int(Path(f"/proc/{pid}/schedstat").read_text().split()[0]) / 1e9
    except OSError:
        return float("inf")


def _processes() -> Iterator[tuple[int, int, str]]:
    """Number, session and name of every living process."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):
                text = (entry / "stat").read_text()
                name, rest = text[text.index("(") + 1 : text.rindex(")")], text[text.rindex(")") + 2 :].split()
                if rest[0] != "Z":
                    yield int(entry.name), int(rest[3]), name


def environment() -> dict[str, str]:
    """Of a command: this checkout's modules, output at once."""
    return {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "PYTHONUNBUFFERED": "1",
        "MPLBACKEND": "agg",
        "SOURCE_DATE_EPOCH": "0",
    }


def serve() -> list[str]:
    """Fork a child for each line; returns, in the child alone, the words of its command."""
    import gc
    import importlib
    import pkgutil

    for name in PRELOADED:
        with contextlib.suppress(ModuleNotFoundError):
            importlib.import_module(name)
    for package in PACKAGES:
        for module in pkgutil.walk_packages([str(ROOT / package)], f"{package}."):
            if not module.name.endswith("__main__"):
                with contextlib.suppress(ModuleNotFoundError):  # of an extra that is not installed
                    importlib.import_module(module.name)
    gc.freeze()
    answers = sys.stdout
    print("ready", flush=True)
    for line in sys.stdin:
        asked = json.loads(line)
        pid = os.fork()
        if pid == 0:
            os.setsid()
            log = os.open(asked["log"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
            os.dup2(log, 1)
            os.dup2(log, 2)
            _limit(asked)
            return list(asked["words"])
        print(pid, file=answers, flush=True)
        sys.stdin.readline()
        _, status, used = os.wait4(pid, 0)
        print(json.dumps((os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime)), flush=True)
    sys.exit(0)


def _limit(asked: dict[str, int]) -> None:
    """What a full disk answers to a write, without one; and an address space that is nearly used up."""
    if "file_bytes" in asked:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (asked["file_bytes"],) * 2)
    if "more_bytes" in asked:
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + asked["more_bytes"],) * 2)


def all_commands(folder: Path) -> dict[str, Command]:
    """Every command on small input, and the files it needs."""
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        return _all_commands(folder)


def _all_commands(folder: Path) -> dict[str, Command]:
    import assets
    from geometry import Board
    from tests.workbench.board_pictures import pictured, pose_of
    from tests.workbench.test_sensor_from_boards import POSES
    from workbench.cli.main import run
    from workbench.files import board_text, write_png
    from workbench.profiles import ScanLine, Told, write_scan_lines

    f = str(folder)
    small = folder / "small.toml"
    text = assets.path("sensors", "nominal").read_text()
    for old, new in (("1280", "640"), ("1024", "512"), ("2300.0", "1150.0"), ("641.3", "320.3"), ("508.9", "254.2")):
        text = text.replace(old, new)
    small.write_text(text)
    images, points, start = folder / "images", folder / "points", folder / "start"
    shutil.copytree(assets.path("samples", "cell_a"), images)
    rows = (images / "frames.csv").read_text().splitlines()
    (images / "frames.csv").write_text("\n".join(rows[:7]) + "\n")
    shutil.copytree(assets.path("samples", "cell_a"), points)
    run(["extract", str(points), "--csv", f"{f}/points.csv"])
    shutil.copy(folder / "points.csv", points)
    shutil.rmtree(points / "images")
    run(["calibrate", str(points), "--out", f"{f}/answer"])
    run(["init", str(start), "--sensor", str(small)])
    run(["init", f"{f}/ball", "--sensor", str(small), "--target", "sphere"])
    made = ["--per-location", "2", "--seed", "1", "--out"]
    run(["render", str(start), *made, f"{f}/truth"])
    run(["render", f"{f}/ball", *made, f"{f}/ball_seen"])
    (folder / "scene.toml").write_text("[[panel]]\nwidth_mm = 60\nheight_mm = 20\ntranslation_mm = [0, 0, 300]\n")
    y = np.linspace(-8, 8, 160)
    for k in range(8):
        r2 = 225.0 - (1.5 * (k - 3.5)) ** 2
        write_scan_lines(folder / "arcs" / f"{k}.csv", [ScanLine(y, 300 - np.sqrt(r2 - y**2))], Told("csv"))
        write_scan_lines(folder / "flats" / f"{k}.csv", [ScanLine(y, 300 + 0.01 * np.sin(y + k))], Told("csv"))
    bars = [ScanLine(y, 300 - np.sqrt(225.0 - (1.5 * (k % 8 - 3.5)) ** 2 - y**2)) for k in range(16)]
    for k, bar in enumerate(bars):
        write_scan_lines(folder / "bar" / f"{k:02d}.csv", [bar], Told("csv"))
    places = [1.5 * (k % 8) + 100 * (k // 8) for k in range(16)]
    (folder / "places.csv").write_text("profile,x_mm\n" + "".join(f"{k:02d},{x}\n" for k, x in enumerate(places)))
    y = np.linspace(-20, 20, 400)
    gap = np.where(np.abs(y) < 2, np.nan, 300 + np.where(y < 0, 0.0, 0.8))
    write_scan_lines(folder / "gap.csv", [ScanLine(y, gap)], Told("csv"))
    study = [f"{i},{o},{t},{i + 0.1 * t + 0.3 * (o == 'B'):.2f}" for i in range(4) for o in "AB" for t in (1, 2)]
    (folder / "study.csv").write_text("part,operator,trial,value\n" + "\n".join(study) + "\n")
    board = Board("circles", 8, 6, 10.0)
    (folder / "board.toml").write_text(board_text(board))
    for i, (tilt, turn, at) in enumerate(POSES):
        R, t = pose_of(board, tilt, turn, at)
        for state in ("off", "on"):
            picture = pictured(board, R, t, np.random.default_rng([i, state == "on"]), state)
            write_png(folder / "boards" / f"{i}_{state}.png", picture)
    (folder / "plan.toml").write_text(
        f"run = 'extract'\nrepeats = 4\nshard_trials = 2\n[base]\nsensor.preset = '{small}'\n"
        "[base.poses]\nplans = 1\nlocations = 1\nper_location = 3\n"
    )
    run(["sweep", f"{f}/plan.toml", "--out", f"{f}/run", "--workers", "1"])
    rng = np.random.default_rng(0)
    joints = folder / "joints.csv"
    joints.write_text("\n".join(",".join(f"{v:.4f}" for v in rng.uniform(-1, 1, 7)) for _ in range(30)) + "\n")
    image = f"{f}/truth/images"
    ball = ["--diameter-mm", "30", "--step-mm", "1.5"]
    kept = ["--out", "OUT/record.json", "--report", "OUT/record.html"]
    data = ["--clearance-mm", "100", "--range-mm", "80", "--near-mm", "50", "--far-mm", "90", "--points", "800"]
    words: dict[str, list[str]] = {
        "init": ["init", "OUT"],
        "datasheet": ["datasheet", "OUT/s.toml", *data, "--repeatability-mm", "0.002"],
        "jig": ["jig", "paper", "--export", "OUT/a.svg", "--export", "OUT/a.dxf", "--export", "OUT/a.stl",
                "--out", "OUT/jig.toml"],
        "render": ["render", str(start), "--out", "OUT", "--per-location", "1", "--seed", "1"],
        "render --profiles": ["render", f"{f}/ball", "--out", "OUT", "--per-location", "1", "--profiles", "gocator"],
        "render --sensor": ["render", f"{f}/scene.toml", "--sensor", str(small), "--out", "OUT/one"],
        "render --board": ["render", "--board", f"{f}/board.toml", "--sensor", str(small), "--views", "2",
                           "--out", "OUT/pairs"],
        "calibrate": ["calibrate", str(points), "--out", "OUT/answer", "--report", "OUT/a.html"],
        "calibrate images": ["calibrate", str(images), "--out", "OUT/answer", "--model", "scp"],
        "calibrate balls": ["calibrate", f"{f}/ball_seen", "--out", "OUT/answer", "--model", "scp"],
        "calibrate --export": ["calibrate", str(points), "--model", "scp", "--export", "fanuc", "OUT/tool.txt"],
        "calibrate --watch": ["calibrate", str(points), "--watch", "--every", "0.1"],
        "verify": ["verify", str(points), "--scp", f"{f}/answer", "--json"],
        "compare": ["compare", f"{f}/answer", f"{f}/answer", "--json"],
        "pose": ["pose", f"{f}/points.csv", "--jig", f"{points}/jig.toml", "--json"],
        "extract": ["extract", str(images), "--csv", "OUT/points.csv", "--overlay", "OUT/seen"],
        "profile": ["profile", f"{f}/ball_seen/images", "--csv", "OUT/csv", "--ply", "OUT/ply", "--overlay", "OUT/png",
                    "--sensor", str(small)],
        "convert": ["convert", f"{f}/gap.csv", "OUT/gap.ply"],
        "gapflush": ["gapflush", f"{f}/gap.csv", "--picture", "OUT/gap.png", "--json"],
        "tune": ["tune", image, "--no-browser"],
        "tune --auto": ["tune", f"{f}/truth", "--auto", "2", "--out", "OUT/tuned"],
        "accept ball": ["accept", "ball", f"{f}/arcs", *ball, *kept],
        "accept spacing": ["accept", "spacing", f"{f}/bar", "--diameter-mm", "30", "--distance-mm", "100",
                           "--positions", f"{f}/places.csv", *kept],
        "accept flatness": ["accept", "flatness", f"{f}/flats", "--step-mm", "1.5", *kept],
        "accept repeat": ["accept", "repeat", f"{f}/flats", "--feature", "plane", *kept],
        "accept gauge": ["accept", "gauge", f"{f}/study.csv", "--tolerance-mm", "1", *kept],
        "twin": ["twin", image, "--sensor", str(small), "--out", "OUT/twin.toml", "--report", "OUT/twin.html"],
        "calibrate-sensor": ["calibrate-sensor", f"{f}/boards", "--board", f"{f}/board.toml",
                             "--out", "OUT/sensor.toml", "--report", "OUT/sensor.html"],
        "validate": ["validate", f"{f}/truth", "--out", "OUT/validation"],
        "validate --frames": ["validate", "--sensor", str(small), "--frames", "2", "--out", "OUT/validation"],
        "plan": ["plan", str(start), "--per-location", "1", "--out", "OUT/frames.csv", "--report", "OUT/plan.html"],
        "closure": ["closure", str(joints), "--robot", "franka_panda", "--out", "OUT/robot.toml"],
        "paper": ["paper", "--runs", "1", "--json"],
        "sweep": ["sweep", f"{f}/plan.toml", "--out", "OUT", "--workers", "1"],
        "report": ["report", f"{f}/run", "--out", "OUT/page.html"],
        "doctor": ["doctor", str(images)],
        "demo": ["demo", "--out", "OUT/demo"],
    }  # fmt: skip
    aside = {"sweep": r".", "tune --auto": r"journal|\.log$"}
    resumes = r"^(\w+/)?\.parts/"  # frames that a broken-off recording need not render again
    endless = ("tune", "calibrate --watch")
    return {
        name: Command(tuple(w), aside.get(name, resumes), aside=name in aside, endless=name in endless)
        for name, w in words.items()
    }


def main() -> None:
    """Kill and corner, print the counts and the faults; the exit code is 1 where there is one."""
    count, seed, corners = ([int(a) for a in sys.argv[1:4]] + [30, 0, 1][len(sys.argv[1:4]) :])[:3]
    with tempfile.TemporaryDirectory() as folder:
        known = undisturbed(Path(folder))
        faults = known.faults + kill(known, count, seed) + (corner(known) if corners else [])
    for fault in faults:
        print("FAULT", fault)
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    if sys.argv[1:] == ["--serve"]:
        sys.argv[1:] = serve()  # from here on in the child alone
        from workbench.cli.main import main as command

        command()
    else:
        main()
