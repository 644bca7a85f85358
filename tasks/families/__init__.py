"""The tasks: one folder a family, in which tasks that are the same idea stand with their words.

A module with a `TASK` (or `TASKS`) has its levels, draw, goal and plan; the TOML file beside it has
its instructions. `robospa.tasks.catalog` lists the modules in the paper's order.
"""
