"""Accepted seeds: scenes that settle and that the expert solves with a robot.

| module | |
|---|---|
| `attempt` | the expert's trial of one seed, finished ones on disk, sweeps of many variants |
| `lists` | where lists are: shipped with the package, or made by this user; what they depend on |
"""
