"""Plans experiments: which genes and effects a campaign will identify, before it is recorded."""

from wingfit.planning.make import plan_dataset, plan_rig
from wingfit.planning.outcome import Plan
from wingfit.planning.spec import PlanSpec

__all__ = ["Plan", "PlanSpec", "plan_dataset", "plan_rig"]
