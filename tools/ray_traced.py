"""Our pictures beside ray traced ones: how far the rasteriser is from the official renderer.

    python tools/ray_traced.py PICTURE [--samples 96]

Draws the head camera's picture of two scenes with our shader and, in the same drawn scene, with
SAPIEN's ray tracer under the official lights (ambient 0.5, a sun, two lamps that shine in all
directions; no denoiser, which needs a GPU). Prints the root mean square difference of each, noise
included, and writes both side by side, ours left. In software 96 samples take four core-minutes.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import sapien
from numpy.typing import NDArray
from PIL import Image

from robospa.harness.sim import furniture
from robospa.harness.sim.bodies import to_sapien
from robospa.harness.sim.cameras import FAR
from robospa.harness.sim.renderer import Renderer
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.observation import CameraSpec
from robospa.protocol.policy import PolicySpec
from robospa.tasks.catalog import build_scene
from robospa.tasks.scene import Lights

SCENES = (("Pick_Mugs_Distance", 3, 300_003), ("Pick_Blocks_Size", 3, 100_003))
HEAD = CameraSpec("head", 320, 240)
DEPTH = 8
"""Bounces of a ray (official)."""


def official_lights(renderer: Renderer) -> None:
    """Lamps that shine in all directions in place of spot lights with a shadow map each."""
    scene = renderer._scene
    for entity in [lamp.entity for lamp in renderer._room._lamps]:
        scene.remove_entity(entity)
    for mark in renderer._abreast._marks:  # hold the cameras of pictures drawn side by side
        scene.remove_entity(mark.entity)
    for at, color in zip(furniture.LAMPS, Lights().lamps, strict=True):
        scene.add_point_light(at, color, shadow=True)


def ray_traced(world: SapienWorld, samples: int) -> NDArray[np.uint8]:
    """The head camera's picture, (240, 320, 3), of the scene that `world` observed last."""
    renderer = world._renderer
    assert renderer is not None
    for entity in renderer._scene.entities:  # bodies have a copy for every picture of a row
        for copy in entity.components[1:]:
            copy.visibility = 0.0
    official_lights(renderer)
    view = renderer.view(HEAD, [{}, {}])
    sapien.render.set_ray_tracing_samples_per_pixel(samples)
    sapien.render.set_ray_tracing_path_depth(DEPTH)
    folder = Path(sapien.__file__).parent / "vulkan_shader" / "rt"
    camera = sapien.render.RenderCameraComponent(HEAD.width, HEAD.height, str(folder))
    camera.set_fovy(view.fov, compute_x=True)
    camera.near, camera.far = view.near, FAR
    mount = sapien.Entity()
    mount.add_component(camera)
    mount.pose = to_sapien(view.pose)
    renderer._scene.add_entity(mount)
    renderer._scene.update_render()
    camera.take_picture()
    return (np.clip(camera.get_picture("Color")[..., :3], 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("picture", type=Path)
    parser.add_argument("--samples", type=int, default=96, help="rays of a pixel")
    options = parser.parse_args()
    rows = []
    for task, level, seed in SCENES:
        world = SapienWorld(render=True)
        world.load(build_scene(task, level, seed))
        ours = world.observe(PolicySpec("pictures", cameras=(HEAD,)))["images"]["head"]
        theirs = ray_traced(world, options.samples)
        error = float(np.sqrt(np.mean((ours.astype(float) - theirs.astype(float)) ** 2)))
        print(f"{task} level {level} seed {seed}: {error:.1f} levels of 255", flush=True)
        rows.append(np.hstack([ours, theirs]))
        world.close()
    Image.fromarray(np.vstack(rows)).save(options.picture)


if __name__ == "__main__":
    main()
