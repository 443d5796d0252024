"""The search itself: Optuna's tree-structured Parzen estimator on the training part, kept on disk trial by trial."""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from extraction import ExtractionConfig
from geometry import InputError, MissingDependencyError
from workbench.tune.cost import total
from workbench.tune.space import Dimension, space, steady, suggest, values_of, with_values
from workbench.tune.task import Task

if TYPE_CHECKING:
    import optuna

Progress = Callable[[int, int, float], None]  # trials done, of how many, best loss so far [mm]
RANDOM_TRIALS = 16  # two for each dimension before the estimator models them, and a median before trials are cut short


@dataclass(frozen=True, eq=False)
class SearchResult:
    """What the search ended with. ``trials``: finished ones in the file; ``resumed``: of those, from earlier runs."""

    config: ExtractionConfig
    train_loss_mm: float
    trials: int
    resumed: int
    interrupted: bool


def search(
    task: Task, start: ExtractionConfig, trials: int, seed: int, journal: Path, progress: Progress
) -> SearchResult:
    """Minimise the loss on the training part, trial by trial.

    Parameters
    ----------
    task
        The images.
    start
        The first trial.
    trials
        How many must stand in the journal in the end.
    seed
        Of the sampler; another seed is another study.
    journal
        Kept after every trial; the same search goes on from it.
    progress
        Told the trials done, the trials in all and the best loss [mm].

    Returns
    -------
    SearchResult
        The best parameters; an interrupted search gives those it has.

    Raises
    ------
    MissingDependencyError, InputError
        Where the extra ``tune`` is missing, or the journal can not be written or is damaged.

    """
    optuna = _optuna()
    dimensions = space(type(start))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        study = _study(optuna, task, start, dimensions, seed, journal)
        resumed = len(_finished(study))
        if not study.trials:
            try:
                study.enqueue_trial(values_of(start, dimensions))
            except OSError as error:
                raise _not_kept(journal, error) from None
        interrupted = _run(optuna, study, task, start, dimensions, trials, journal, progress)
    if not any(t.value is not None and t.state.name == "COMPLETE" for t in study.trials):
        raise InputError("the search was interrupted before its first trial ended")
    best = with_values(start, steady({d.key: study.best_trial.params[d.key] for d in dimensions}))
    return SearchResult(best, float(study.best_value), len(_finished(study)), resumed, interrupted)


def _optuna() -> Any:
    try:
        import optuna
    except ModuleNotFoundError:
        raise MissingDependencyError("--auto needs its extra: pip install 'perceptron-emu[tune]'") from None
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    return optuna


def _study(
    library: Any, task: Task, start: ExtractionConfig, dimensions: tuple[Dimension, ...], seed: int, journal: Path
) -> optuna.Study:
    """The study of this task in the journal: another dataset, start, space or seed is another study."""
    name = _name(task, start, dimensions, seed)
    try:
        journal.parent.mkdir(parents=True, exist_ok=True)
        _drop_cut_line(journal)
        storage = library.storages.JournalStorage(library.storages.journal.JournalFileBackend(str(journal)))
        sampler = library.samplers.TPESampler(seed=seed, n_startup_trials=RANDOM_TRIALS, multivariate=True)
        pruner = library.pruners.MedianPruner(n_startup_trials=RANDOM_TRIALS, n_warmup_steps=3)
        options = {"storage": storage, "sampler": sampler, "pruner": pruner, "load_if_exists": True}
        study = library.create_study(study_name=name, **options)
    except OSError as error:
        raise _not_kept(journal, error) from None
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, RecursionError):  # of lines that are no record
        raise InputError(f"{journal}: is damaged; delete it to start the search anew") from None
    done = len(study.trials)
    if done:  # a resumed search must not draw the numbers of its beginning again
        study.sampler = library.samplers.TPESampler(seed=seed + done, n_startup_trials=RANDOM_TRIALS, multivariate=True)
    return cast("optuna.Study", study)


def _drop_cut_line(journal: Path) -> None:
    """A killed search may leave its last line unfinished: what it told is lost, the lines before it are not."""
    if not journal.exists():
        return
    if not journal.is_file():
        raise InputError(f"{journal}: is no file; choose a folder with --out")
    with journal.open("r+b") as stream:
        data = stream.read()
        if data and not data.endswith(b"\n"):
            stream.truncate(data.rfind(b"\n") + 1)


def _name(task: Task, start: ExtractionConfig, dimensions: tuple[Dimension, ...], seed: int) -> str:
    pictures = task.source.pictures
    stamps = [(pictures.name(i), pictures.stamp(i).size, pictures.stamp(i).mtime_ns) for i in task.images]
    content = [start.model_dump_json(), [d.__dict__ for d in dimensions], stamps, task.train, seed, task.has_truth]
    return "tune " + hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]


def _finished(study: optuna.Study) -> list[Any]:
    return [t for t in study.trials if t.state.name in ("COMPLETE", "PRUNED")]


def _run(
    library: Any,
    study: optuna.Study,
    task: Task,
    start: ExtractionConfig,
    dimensions: tuple[Dimension, ...],
    trials: int,
    journal: Path,
    progress: Progress,
) -> bool:
    """Run what is missing; True where it was interrupted. InputError where the journal can not be written on."""
    unwritten: list[OSError] = []  # Optuna stumbles over it in words of its own

    def objective(trial: optuna.Trial) -> float:
        try:
            return loss_mm(trial)
        except OSError as error:
            unwritten.append(error)
            raise

    def loss_mm(trial: optuna.Trial) -> float:
        config = suggest(trial, dimensions, start)
        scores = []
        for step, index in enumerate(task.train):
            scores.append(task.score(index, config))
            trial.report(total(scores).loss_mm, step)
            if trial.should_prune():
                raise library.TrialPruned
        return total(scores).loss_mm

    def told(study: optuna.Study, _trial: Any) -> None:
        progress(len(_finished(study)), trials, _best(study))

    missing = trials - len(_finished(study))
    try:
        if missing > 0:
            study.optimize(objective, n_trials=missing, callbacks=[told], gc_after_trial=False)
    except KeyboardInterrupt:
        return True
    except (OSError, AssertionError) as error:
        if isinstance(error, OSError):
            unwritten.append(error)
        if not unwritten:
            raise
        raise _not_kept(journal, unwritten[0]) from None
    return False


def _not_kept(journal: Path, error: OSError) -> InputError:
    return InputError(f"{journal}: the search can not be kept there ({error.strerror}); choose a folder with --out")


def _best(study: optuna.Study) -> float:
    values = [t.value for t in study.trials if t.state.name == "COMPLETE" and t.value is not None]
    return min(values, default=float("nan"))
