"""Look at a trial before any policy does: its scene as a value, its sentence, its pictures.

python examples/look_at_a_scene.py --task Stack_Blocks_Color_Order --level 3 --out scene.png
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from PIL import Image

import robospa
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.tasks.sentences import instruction


def main() -> None:
    """Print what the scene holds, and write what the cameras see."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--task", default="Pick_Blocks_Size")
    parser.add_argument("--level", type=int, default=3)
    parser.add_argument("--seed", type=int, default=100_000)
    parser.add_argument("--mode", default="clean", help="or randomized")
    parser.add_argument("--cameras", default="head,left_wrist,right_wrist")
    parser.add_argument("--out", default="scene.png", help="a picture, or a folder for one")
    words = parser.parse_args()

    # A pure function: the same arguments give the same scene, everywhere.
    scene = robospa.build_scene(words.task, words.level, words.seed, mode=words.mode)
    print(f"{scene.task}, level {scene.level}, seed {scene.seed}: {instruction(scene)}")
    for item in scene.objects:
        x, y, z = item.pose.position
        print(f"  {item.name}: {item.asset} at x {x:+.3f}, y {y:+.3f}, z {z:.3f} m")

    world = SapienWorld()
    world.load(scene)  # objects at rest, arms at home
    cameras = [robospa.CameraSpec(name) for name in words.cameras.split(",")]
    pictures = [world.render(camera) for camera in cameras]
    world.close()
    out = Path(words.out)
    out = out if out.suffix else out / "scene.png"
    out.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.concatenate(pictures, axis=1)).save(out)
    print(f"{out}: {words.cameras}")


main()
