"""Random actions through Gymnasium: one environment, or several in processes of their own.

python examples/gymnasium_rollout.py --task Pick_Blocks_Size --level 3 --steps 20
python examples/gymnasium_rollout.py --envs 4
"""

from __future__ import annotations

import argparse

import gymnasium

import robospa.gym  # noqa: F401  (makes the tasks known to Gymnasium)


def main() -> None:
    """Step, and print how far it got."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--task", default="Pick_Blocks_Size")
    parser.add_argument("--level", type=int, default=1)
    parser.add_argument("--seed", type=int, default=100_000, help="the first trial's seed")
    parser.add_argument("--steps", type=int, default=10)
    parser.add_argument("--envs", type=int, default=1)
    words = parser.parse_args()
    name = f"RoboSPA/{words.task}-v3"  # 3 is the suite's version
    if words.envs == 1:
        env = gymnasium.make(name, level=words.level)
        _, info = env.reset(seed=words.seed)
        print(info["instruction"])
        for _ in range(words.steps):
            _, _, terminated, truncated, info = env.step(env.action_space.sample())
            if terminated or truncated:
                break
        print(f"{info['steps']} actions, {info['done']} of {info['total']} subtasks")
    else:
        envs = gymnasium.make_vec(name, words.envs, vectorization_mode="async", level=words.level)
        envs.reset(seed=words.seed)  # trials of this seed and those after it
        for _ in range(words.steps):
            _, rewards, *_ = envs.step(envs.action_space.sample())
        print(f"{words.envs} environments, rewards of the last step {rewards.tolist()}")
        envs.close()
        return
    env.close()


if __name__ == "__main__":  # environments of a vector run in processes of their own
    main()
