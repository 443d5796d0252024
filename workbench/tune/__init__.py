"""Automatic tuning: a search over extraction's parameters, judged on images that it has not seen."""

from workbench.tune.cost import Score
from workbench.tune.judgement import Judgement, judge
from workbench.tune.study import SearchResult, search
from workbench.tune.task import Task, make_task

__all__ = [
    "Judgement",
    "Score",
    "SearchResult",
    "Task",
    "judge",
    "make_task",
    "search",
]
