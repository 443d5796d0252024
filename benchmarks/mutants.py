"""Tests that bite: random mutants of the packages, and the share of them that the default tests kill.

Cosmic Ray makes the mutants and keeps the session (`cr-report build/mutants/session_300_1.sqlite` reads it); this
chooses and runs the tests. A mutant is met by the tests that execute its line when nothing is wrong, those that hold
figures and the quick before others, and the first that fails ends it; compiled kernels, whose lines no coverage sees,
are met by the tests of what calls them, and a line of a module or class by the tests of what uses its name. A mutant
that needs more than `PATIENCE_S` of tests survives, as does one that no test executes: the share is a lower bound of
the whole suite's.
Left out are mutants that nobody could tell: in annotations and under TYPE_CHECKING, which nothing evaluates, and `is`
for `==`.
All happens in a copy of the checkout, kernels' caches too, so that an end at any moment leaves nothing behind; run
again with the same numbers it goes on where it ended, with the tests as they are then and the packages as they were:
`build/mutants` goes away with packages that are no more.
Run: python benchmarks/mutants.py [mutants, default 300] [seed, default 1]; the exit code is 1 below 92 %.
"""

from __future__ import annotations

import ast
import hashlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
import traceback
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("geometry", "jig_cad", "extraction", "calib", "perceptron_emu")
TESTED = (*PACKAGES, "workbench", "profiles", "compare", "accept")  # folders of tests that are mapped
ENOUGH = 0.92
PATIENCE_S = 90.0  # processor time of tests a mutant, as they took when nothing was wrong
SLOWER = 6.0  # times what they took: beyond it a mutant has made something endless
BUSY = 10  # times that, by the clock: beyond it something waits for ever
EQUAL = ("ReplaceComparisonOperator_Is_Eq", "ReplaceComparisonOperator_IsNot_NotEq")
RAN = (0, 1, 5)  # pytest's exit codes where tests were run, or none was asked for
FAILED = (1, 2, 4)  # pytest's exit codes where a test failed, or a mutant broke the imports of the tests
READING = "tests/workbench/test_nouns.py"  # reads the source of classes, of which it executes nothing
BROKEN = 70  # what else ends a run of tests is a fault of this program
MAP = "COVERED_LINES"  # environment: where the run of all tests writes its map


def main() -> int:
    """Map the tests, draw the mutants, run what is left to run, print the counts and the survivors."""
    count, seed = ([int(a) for a in sys.argv[1:3]] + [300, 1][len(sys.argv[1:3]) :])[:2]
    folder = ROOT / "build" / "mutants"
    tree = folder / "checkout"
    _copied(tree)
    os.chdir(tree)
    os.environ.update(PYTHONPATH=str(tree), PYTHONDONTWRITEBYTECODE="1")
    maps = _mapped(folder)
    tests = Tests.read(maps, tree)
    from cosmic_ray.work_db import WorkDB, use_db
    from cosmic_ray.work_item import TestOutcome

    with use_db(str(folder / f"session_{count}_{seed}.sqlite"), WorkDB.Mode.create) as session:
        if not session.num_work_items:
            _drawn(session, count, seed)
        _preloaded()
        sound, output = _run(sorted(t for t in tests.seconds if "::" in t)[:20], tests, folder)
        if sound != TestOutcome.SURVIVED:
            raise RuntimeError(f"the tests fail without any mutant\n{output}")
        pending = sorted(
            session.pending_work_items,
            key=lambda item: (
                str(item.mutations[0].module_path),
                item.mutations[0].operator_name,
                item.mutations[0].occurrence,
            ),
        )
        random.Random(seed).shuffle(pending)  # noqa: S311 - ended before all are met, those met are of all packages
        for item in pending:
            _met(item, session, tests, folder)
        return _told(session)


def _copied(tree: Path) -> None:
    """What git knows of the checkout, its bytecode, and the kernels that are compiled; later the tests alone."""
    again = (tree.parent / "kernels").exists()
    words = [
        "git",
        "ls-files",
        "-z",
        "--cached",
        "--others",
        "--exclude-standard",
        *(["tests", "benchmarks/mutants.py"] if again else []),
    ]
    listed = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)  # noqa: S603
    for name in filter(None, listed.stdout.split("\0")):
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, tree / name)
    if again:
        return
    subprocess.run([sys.executable, "-m", "compileall", "-q", *PACKAGES, "workbench", "tests"], cwd=tree, check=True)  # noqa: S603
    from numba.core.caching import UserProvidedCacheLocator

    kept = (file for name in (*PACKAGES, "workbench") for file in (ROOT / name).glob("**/__pycache__/*.nb[ic]"))
    for file in kept:  # the same source under another path has the same stamp
        beside = tree / file.relative_to(ROOT).parent.parent / "kernels.py"
        place = tree.parent / "kernels" / UserProvidedCacheLocator.get_suitable_cache_subpath(str(beside))
        place.mkdir(parents=True, exist_ok=True)
        shutil.copy2(file, place / file.name)


def _mapped(folder: Path) -> list[Path]:
    """Maps of all files of tests: which lines each test executes and how long it takes; of changed ones anew."""
    maps = folder / "lines"
    maps.mkdir(exist_ok=True)
    kept = []
    env = {**os.environ, MAP: str(maps), "NUMBA_CACHE_DIR": str(folder / "kernels")}
    for name in TESTED:
        of = {str(file): _map(maps, file) for file in sorted(Path("tests", name).glob("test_*.py"))}
        left = [file for file, path in of.items() if not path.exists()]
        if left:
            words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "benchmarks.mutants"]
            subprocess.run([*words, *left], env=env, check=True)  # noqa: S603
        kept += of.values()
    return kept


def _map(maps: Path, file: str | Path) -> Path:
    """Where the map of a file of tests is kept, by its name and what it holds."""
    text = Path(file).read_bytes()
    return maps / f"{str(file).replace(os.sep, '.')}.{hashlib.sha256(text).hexdigest()[:12]}.json"


class Coverage:
    """pytest plugin of that run: executed lines by test; what fixtures execute counts for all tests of their file."""

    def __init__(self, out: Path) -> None:
        import coverage

        self.out = out
        self.seconds: Counter[str] = Counter()
        self.failed: set[str] = set()
        self.used_s = _cpu_s()
        self.coverage = coverage.Coverage(data_file=None, source=list(PACKAGES), config_file=False)
        self.coverage.start()

    def pytest_sessionstart(self, session: object) -> None:
        """The files that were asked for: also one all of whose tests are not of the default gets a map."""
        self.files = [Path(a).as_posix() for a in session.config.args]  # type: ignore[attr-defined]

    def pytest_runtest_logreport(self, report: object) -> None:
        """Sum up a test's processor time over its parameters; a fixture's is the file's."""
        before, self.used_s = self.used_s, _cpu_s()
        node = _name(report.nodeid)  # type: ignore[attr-defined]
        whole = report.when != "call"  # type: ignore[attr-defined]
        self.seconds[node.split("::")[0] if whole else node] += self.used_s - before
        if report.failed:  # type: ignore[attr-defined]
            self.failed.add(node)

    def pytest_runtest_setup(self, item: object) -> None:
        """From here on lines are the file's."""
        self.coverage.switch_context(item.nodeid.split("::")[0])  # type: ignore[attr-defined]

    def pytest_runtest_call(self, item: object) -> None:
        """From here on lines are the test's."""
        self.coverage.switch_context(_name(item.nodeid))  # type: ignore[attr-defined]

    def pytest_sessionfinish(self, exitstatus: int) -> None:
        """Write the maps: of a file its tests that pass, of every line the numbers of those that meet it."""
        self.coverage.stop()
        if exitstatus not in RAN:  # a file could not be imported, and no test of any was run
            return
        data = self.coverage.get_data()
        by_line = {str(Path(f).relative_to(Path.cwd())): data.contexts_by_lineno(f) for f in data.measured_files()}
        for test_file in self.files:
            names = sorted(n for n in {*self.seconds} - self.failed if n.split("::")[0] == test_file)
            number = {name: i for i, name in enumerate(names)}
            lines = {
                file: {
                    str(n): met
                    for n, contexts in of.items()
                    if (met := sorted({number[c] for c in contexts if c in number}))
                }
                for file, of in by_line.items()
            }
            shown = {
                "tests": [[n, round(self.seconds[n], 3)] for n in names],
                "lines": {f: of for f, of in lines.items() if of},
            }
            _map(self.out, test_file).write_text(json.dumps(shown))


def pytest_configure(config: object) -> None:
    """As a plugin: measure where the map is asked for, and let hypothesis find a failure without making it small."""
    if MAP in os.environ:
        config.pluginmanager.register(Coverage(Path(os.environ[MAP])))  # type: ignore[attr-defined]
        return
    import hypothesis

    phases = (hypothesis.Phase.explicit, hypothesis.Phase.generate)
    hypothesis.settings.register_profile("mutants", deadline=None, database=None, derandomize=True, phases=phases)
    hypothesis.settings.load_profile("mutants")


def _cpu_s() -> float:
    """Of this process and of those that it waited for: a busy machine makes no test dearer."""
    return sum(os.times()[:4])


def _name(node: str) -> str:
    return node.split("[", maxsplit=1)[0]


@dataclass
class Tests:
    """Which tests meet a line."""

    seconds: dict[str, float]
    lines: dict[str, dict[int, set[str]]]  # file → line → tests
    trees: dict[str, ast.Module]
    holding: set[str]  # tests whose figures are kept
    uses: dict[str, set[tuple[str, int]]] = field(default_factory=lambda: defaultdict(set))  # name → (file, line)

    @classmethod
    def read(cls, paths: list[Path], tree: Path) -> Tests:
        """The maps that the runs of all tests wrote, and where the packages use which names."""
        seconds: dict[str, float] = {}
        lines: dict[str, dict[int, set[str]]] = {}
        for path in paths:
            kept = json.loads(path.read_text())
            seconds |= dict(kept["tests"])
            for file, by_line in kept["lines"].items():
                here = lines.setdefault(file, {})
                for n, of in by_line.items():
                    here.setdefault(int(n), set()).update(kept["tests"][i][0] for i in of)
        files = [f for p in PACKAGES for f in sorted((tree / p).rglob("*.py"))]
        trees = {str(f.relative_to(tree)): ast.parse(f.read_text()) for f in files}
        tests = cls(seconds, lines, trees, _holding(tree / "tests"))
        for file, module in trees.items():
            for node in ast.walk(module):
                name = {ast.Name: "id", ast.Attribute: "attr", ast.keyword: "arg"}.get(type(node))
                if name:
                    tests.uses[str(getattr(node, name))].add((file, node.lineno))  # type: ignore[attr-defined]
        return tests

    def of(self, file: str, line: int, seen: frozenset[str] = frozenset()) -> set[str]:
        """Tests that meet a line: those that execute it or, where it runs compiled or on import, what uses it."""
        functions, top = _around(self.trees[file], line)
        compiled = [f for f in functions if any("kernel" in ast.unparse(d) for d in f.decorator_list)]
        if compiled:
            return self._of_names([compiled[-1].name], seen)
        if functions:
            inner = functions[-1]
            if line >= inner.body[0].lineno:
                return self.lines.get(file, {}).get(line, set()) or self._nearest(file, inner, line)
            return set().union(*(self.lines.get(file, {}).get(n, set()) for n in _span(inner.body)))
        if isinstance(top, (ast.Assign, ast.AnnAssign)):
            targets = top.targets if isinstance(top, ast.Assign) else [top.target]
            return self._of_names([n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)], seen)
        return {READING} | set().union(*self.lines.get(file, {}).values())

    def _nearest(self, file: str, inner: ast.FunctionDef | ast.AsyncFunctionDef, line: int) -> set[str]:
        """A line inside a statement of several lines: coverage knows its first."""
        starts = [n.lineno for n in ast.walk(inner) if isinstance(n, ast.stmt) and n.lineno <= line]
        return self.lines.get(file, {}).get(max(starts), set()) if starts else set()

    def _of_names(self, names: list[str], seen: frozenset[str]) -> set[str]:
        found: set[str] = set()
        for name in names:
            if name not in seen:
                for file, line in self.uses[name]:
                    functions, top = _around(self.trees[file], line)
                    if functions or isinstance(top, (ast.Assign, ast.AnnAssign)):  # a constant made of a constant
                        found |= self.of(file, line, seen | {*names})
        return found

    def ordered(self, tests: set[str], package: str) -> list[str]:
        """The package's own first, what holds figures, what is quick; of fixtures that work all their file's."""
        whole = {t for t in tests if "::" not in t}
        alone = {t for t in tests if t.split("::")[0] not in whole}
        spread = {t for t in self.seconds if "::" in t and t.split("::")[0] in whole}
        both = {t: self.seconds[t] + 0.3 * self.seconds.get(t.split("::")[0], 0.0) for t in alone | spread}

        def late(test: str) -> float:
            return (
                both[test] * (1 if test.startswith(f"tests/{package}/") else 3) * (0.2 if test in self.holding else 1)
            )

        quick = sorted(both, key=lambda t: (late(t), t))
        taken, total = [], 0.0
        for test in quick:
            total += both[test]
            if total > PATIENCE_S and taken:
                break
            taken.append(test)
        return taken


def _holding(folder: Path) -> set[str]:
    """Tests that `tests/pinned.py` keeps figures of: they fail where any figure of a result is another."""
    found = set()
    for package in TESTED:
        for file in (folder / "figures").glob(f"{package}_*.json"):
            of = f"tests/{package}/test_{file.stem.removeprefix(f'{package}_')}.py"
            found |= {_name(f"{of}::{test.split(' ')[0]}") for test in json.loads(file.read_text())}
    return found


def _around(module: ast.Module, line: int) -> tuple[list[ast.FunctionDef | ast.AsyncFunctionDef], ast.stmt | None]:
    """The functions that hold a line, outermost first, and the innermost statement of a module or class."""
    functions: list[ast.FunctionDef | ast.AsyncFunctionDef] = []
    top: ast.stmt | None = None
    for node in ast.walk(module):
        if not isinstance(node, ast.stmt):
            continue
        decorators = getattr(node, "decorator_list", [])
        first = min([node.lineno, *(d.lineno for d in decorators)])
        if first <= line <= (node.end_lineno or node.lineno):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                functions.append(node)
            elif not functions:
                top = node
    return functions, top


def _span(body: list[ast.stmt]) -> Iterator[int]:
    yield from range(body[0].lineno, (body[-1].end_lineno or body[-1].lineno) + 1)


def _drawn(session: object, count: int, seed: int) -> None:
    """By the seed so many mutants: a file by the length of its code, of all that Cosmic Ray makes of it one."""
    from cosmic_ray.commands.init import _all_work_items

    rng = random.Random(seed)  # noqa: S311
    files = [f for p in PACKAGES for f in sorted(Path(p).rglob("*.py"))]
    drawn = Counter(rng.choices(files, [len(f.read_text().splitlines()) for f in files], k=count))
    for file in sorted(drawn):
        unread = _unread(ast.parse(file.read_text()))
        fair = [item for item in _all_work_items([file], {}) if _can_be_told(item.mutations[0], unread)]
        fair.sort(key=lambda item: (item.mutations[0].operator_name, item.mutations[0].occurrence))
        session.add_work_items(rng.sample(fair, min(drawn[file], len(fair))))  # type: ignore[attr-defined]


def _unread(module: ast.Module) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Where annotations stand and what a type checker alone reads, from and to."""
    parts: list[ast.AST | None] = []
    for node in ast.walk(module):
        parts += [getattr(node, "annotation", None), getattr(node, "returns", None)]
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            parts += [node.test, *node.body]
    return [((p.lineno, p.col_offset), (p.end_lineno or 0, p.end_col_offset or 0)) for p in parts if p]  # type: ignore[attr-defined]


def _can_be_told(mutation: object, unread: list[tuple[tuple[int, int], tuple[int, int]]]) -> bool:
    at = tuple(mutation.start_pos)  # type: ignore[attr-defined]
    if any(str(mutation.operator_name).endswith(name) for name in EQUAL):  # type: ignore[attr-defined]
        return False
    return not any(start <= at < end for start, end in unread)


def _preloaded() -> None:
    """What every run of tests imports of others, once: each mutant's process is a fork of this one."""
    import cv2
    import numba
    import pydantic
    import pytest
    import scipy.linalg
    import scipy.optimize
    import scipy.sparse
    import scipy.spatial
    import scipy.stats
    import trimesh

    assert all((cv2, numba, pydantic, pytest, scipy, trimesh))  # they are wanted for being loaded
    assert not {*PACKAGES} & {*sys.modules}, "the packages themselves are each mutant's own"


def _met(item: object, session: object, tests: Tests, folder: Path) -> None:
    """Make one mutant, run its tests in a fork of this process, note the outcome."""
    from cosmic_ray.mutating import _make_diff, use_mutation
    from cosmic_ray.plugins import get_operator
    from cosmic_ray.work_item import TestOutcome, WorkerOutcome, WorkResult

    mutation = item.mutations[0]  # type: ignore[attr-defined]
    path = Path(mutation.module_path)
    chosen = tests.ordered(tests.of(str(path), mutation.start_pos[0]), path.parts[0])
    start = time.perf_counter()
    operator = get_operator(mutation.operator_name)(**mutation.operator_args)
    with use_mutation(path, operator, mutation.occurrence) as (before, after):
        diff = "\n".join(_make_diff(before, after or before, path))
        outcome, output = _run(chosen, tests, folder) if chosen else (TestOutcome.SURVIVED, "no test executes it")
    result = WorkResult(worker_outcome=WorkerOutcome.NORMAL, output=output, test_outcome=outcome, diff=diff)
    session.set_result(item.job_id, result)  # type: ignore[attr-defined]
    took = time.perf_counter() - start
    print(f"{took:6.1f} s {outcome.value:9s} {len(chosen):4d} tests  {path}:{mutation.start_pos[0]}", flush=True)


def _run(chosen: list[str], tests: Tests, folder: Path) -> tuple[object, str]:
    """Run tests in a fork, with the kernels as they are compiled of sound source, until one fails."""
    from cosmic_ray.work_item import TestOutcome

    kernels = folder / "kernels_of_mutant"
    shutil.rmtree(kernels, ignore_errors=True)
    shutil.copytree(folder / "kernels", kernels, copy_function=os.link)
    out = folder / "output.txt"
    most_s = 120 + int(SLOWER * sum(tests.seconds[t] for t in chosen))
    child = os.fork()
    if child == 0:
        _in_the_fork(chosen, kernels, out, most_s)
    limit = time.monotonic() + BUSY * most_s
    while True:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            break
        if time.monotonic() > limit:
            os.killpg(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return TestOutcome.KILLED, "timeout"
        time.sleep(0.02)
    text = out.read_text(errors="replace")
    code = os.waitstatus_to_exitcode(status)
    if code not in (0, *FAILED) and code >= 0:  # a mutant may end its process by a signal
        raise RuntimeError(f"the tests could not be run: exit code {code}\n{text[-4000:]}")
    return (TestOutcome.SURVIVED if code == 0 else TestOutcome.KILLED), text[-4000:]


def _in_the_fork(chosen: list[str], kernels: Path, out: Path, most_s: int) -> None:
    code = BROKEN
    try:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_CPU, (most_s, most_s))  # ends it by a signal
        descriptor = os.open(out, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(descriptor, 1)
        os.dup2(descriptor, 2)
        os.environ["NUMBA_CACHE_DIR"] = str(kernels)
        import numba
        import pytest

        numba.config.CACHE_DIR = str(kernels)  # type: ignore[attr-defined] # set by numba as it starts
        sys.path.insert(0, str(Path.cwd()))
        code = int(
            pytest.main(["-q", "-x", "--tb=line", "-p", "no:cacheprovider", "-p", "benchmarks.mutants", *chosen])
        )
    except BaseException:  # noqa: BLE001 - a fork must not go on as its parent
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        os._exit(code)


def _told(session: object) -> int:
    """Print the counts and every survivor's difference."""
    from cosmic_ray.work_item import TestOutcome

    counts: Counter[str] = Counter()
    killed: Counter[str] = Counter()
    left = []
    results = dict(session.results)  # type: ignore[attr-defined]
    for item in session.work_items:  # type: ignore[attr-defined]
        result = results.get(item.job_id)
        if result is None:
            continue
        package = Path(item.mutations[0].module_path).parts[0]
        counts[package] += 1
        killed[package] += result.test_outcome != TestOutcome.SURVIVED
        if result.test_outcome == TestOutcome.SURVIVED:
            left.append(result.diff if "no test" not in result.output else f"no test executes it\n{result.diff}")
    for diff in left:
        print("\n".join(line for line in diff.splitlines() if not line.startswith("---")))
    for package in counts:
        print(f"{package:16s} {killed[package]:4d} of {counts[package]:4d} killed")
    dead, made = sum(killed.values()), sum(counts.values())
    share = dead / max(made, 1)
    print(f"{dead} of {made} mutants killed: {100 * share:.1f} %, asked {100 * ENOUGH:.0f} %")
    return 0 if share >= ENOUGH else 1


if __name__ == "__main__":
    sys.exit(main())
