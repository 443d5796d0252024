"""Views of a target: what a sensor can see and an arm can reach, and which views tell most."""

from workbench.plan.choose import LEVER_MM, RANDOM_PLANS, random_plans, size_mm
from workbench.plan.clearance import (
    HAND_MM,
    SAFE_MM,
    Standing,
    carrying,
    room_at_target_mm,
    room_before_fixed,
    room_in_workspace_mm,
    standing,
    target_boxes,
)
from workbench.plan.expected import expected_points
from workbench.plan.moves import Move
from workbench.plan.next_view import NextView, SurfacePlan, next_views
from workbench.plan.on_surface import propose_on_surface
from workbench.plan.proposal import Proposal, ViewPools, best_plan, candidates, plan_limits, pooled, propose
from workbench.plan.view_space import ViewLimits
from workbench.plan.views import ViewProblem, Views, free_views, plan_views
from workbench.plan.watching import NextPose, Round, rounds
from workbench.plan.whole import Whole, seen_whole

__all__ = [
    "HAND_MM",
    "LEVER_MM",
    "RANDOM_PLANS",
    "SAFE_MM",
    "Move",
    "NextPose",
    "NextView",
    "Proposal",
    "Round",
    "Standing",
    "SurfacePlan",
    "ViewLimits",
    "ViewPools",
    "ViewProblem",
    "Views",
    "Whole",
    "best_plan",
    "candidates",
    "carrying",
    "expected_points",
    "free_views",
    "next_views",
    "plan_limits",
    "plan_views",
    "pooled",
    "propose",
    "propose_on_surface",
    "random_plans",
    "room_at_target_mm",
    "room_before_fixed",
    "room_in_workspace_mm",
    "rounds",
    "seen_whole",
    "size_mm",
    "standing",
    "target_boxes",
]
