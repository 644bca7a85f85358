"""Where things lie: samplers of free places, of grids, and of turns, all bounded in work.

What does not succeed in a fixed number of draws raises `LayoutError`: the seed is not valid, and
building a scene always takes milliseconds. Positions are metres in the world frame. Nothing here
knows a simulator, a robot or a task.
"""
