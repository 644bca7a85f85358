"""The tasks: a module for each family of tasks that are the same idea.

A module has levels, draw, goal and plan of its tasks; the TOML files beside it, which begin with
its name, have their instructions. `robospa.tasks.catalog` lists the tasks in the paper's order.
"""
