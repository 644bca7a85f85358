"""Make the tasks known to Gymnasium.

    import gymnasium
    import robospa.gym

    env = gymnasium.make("RoboSPA/Pick_Blocks_Size-v3", level=3)

`gymnasium.make("robospa.gym:RoboSPA/Pick_Blocks_Size-v3")` imports this module by itself. It needs
the extras `gym` and `sim`.
"""

from importlib import import_module

import_module("robospa.harness.gym.environment").register_tasks()
