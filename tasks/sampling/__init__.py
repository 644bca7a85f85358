"""Where things lie: samplers of free places, all bounded in work.

| module | a layout is | for |
|---|---|---|
| `scatter` | drawn object by object from many candidates at once | most tasks |
| `points` | drawn point by point, each until it fits | few things, each with a rule |
| `batch` | the first good one of thousands drawn whole | towers: every layout equally likely |
| `markov` | a state of random walks inside the valid ones | layouts that nearly fill their region |
| `grid` | rows and columns with jitter | counted places |

What does not succeed in a fixed number of draws raises `LayoutError`: the seed is not valid, and
building a scene always takes milliseconds. Positions are metres in the world frame. Nothing here
knows a simulator, a robot or a task.
"""
