"""Views of a target: what a sensor can see and an arm can reach, and which views tell most."""

from workbench.plan.choose import LEVER_MM, RANDOM_PLANS, random_plans, size_mm
from workbench.plan.expected import expected_points
from workbench.plan.proposal import Proposal, ViewPools, best_plan, candidates, plan_limits, pooled, propose
from workbench.plan.view_space import ViewLimits
from workbench.plan.views import ViewProblem, Views, free_views, plan_views

__all__ = [
    "LEVER_MM",
    "RANDOM_PLANS",
    "Proposal",
    "ViewLimits",
    "ViewPools",
    "ViewProblem",
    "Views",
    "best_plan",
    "candidates",
    "expected_points",
    "free_views",
    "plan_limits",
    "plan_views",
    "pooled",
    "propose",
    "random_plans",
    "size_mm",
]
