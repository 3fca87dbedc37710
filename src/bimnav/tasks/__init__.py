"""Tasks: what a robot is to visit in any building, what blocks it, and why each element was picked."""

from bimnav.tasks._check import RuleCheck, check_rules
from bimnav.tasks._choose import Choice, Overruled, choose
from bimnav.tasks._files import FileCheck, TaskInfo, check_file, entourage, list_tasks, load_task, task_schema
from bimnav.tasks._lint import lint_rules
from bimnav.tasks._match import Match, match, rules_for, told
from bimnav.tasks._task import Destination, Rule, Standoff, Task

__all__ = [
    "Choice",
    "Destination",
    "FileCheck",
    "Match",
    "Overruled",
    "Rule",
    "RuleCheck",
    "Standoff",
    "Task",
    "TaskInfo",
    "check_file",
    "check_rules",
    "choose",
    "entourage",
    "lint_rules",
    "list_tasks",
    "load_task",
    "match",
    "rules_for",
    "task_schema",
    "told",
]
