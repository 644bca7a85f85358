"""Rendering: what an observation of three 320x240 cameras costs, beside bare SAPIEN capture.

    python benchmarks/rendering.py [--rounds 15]

"observation" is `SapienWorld.observe` of a scene with both arms and eight objects: posing the drawn
scene, three pictures, conversion to uint8, state. "bare" takes the same three pictures of the same
drawn scene with SAPIEN's own calls and its default shader, converted the same way; "primitives"
does so with the arms taken away. Sides take turns; medians of wall and of CPU time (all threads:
the software device uses every core). Prints JSON.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import sapien
from physics import table_of_blocks  # type: ignore[import-not-found]

from robospa.harness.sapien_world import SapienWorld, versions
from robospa.protocol.policy import PolicySpec

BAR_MS = 120.0
READY = (0.0, 1.6, 1.5, 0.0, 0.0, 0.0, 1.0)


def bare_cameras(world: SapienWorld) -> tuple[Any, list[Any]]:
    """SAPIEN cameras with its default shader where the world's are, in the world's drawn scene."""
    studio = world._studio
    assert studio is not None
    cameras = []
    for camera in list(studio._cameras.values()):
        twin = sapien.render.RenderCameraComponent(camera.width, camera.height)
        twin.set_fovy(camera.fovy, compute_x=True)
        twin.near, twin.far = camera.near, camera.far
        mount = sapien.Entity()
        mount.add_component(twin)
        mount.pose = camera.entity.pose
        studio._scene.add_entity(mount)
        cameras.append(twin)
    return studio._scene, cameras


def capture(scene: Any, cameras: list[Any]) -> list[Any]:
    """Three pictures as one would write it by hand."""
    scene.update_render()
    images = []
    for camera in cameras:
        camera.take_picture()
        colors = camera.get_picture("Color")[..., :3]
        images.append((np.clip(colors, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8))
    return images


def timed(run: Callable[[], Any]) -> tuple[float, float]:
    """Wall and CPU time [ms] of one call."""
    wall, cpu = time.perf_counter(), time.process_time()
    run()
    return (time.perf_counter() - wall) * 1e3, (time.process_time() - cpu) * 1e3


def open_world() -> SapienWorld:
    """A world with eight blocks and both arms over the table."""
    world = SapienWorld(render=True)
    world.load(table_of_blocks(8))
    world.step(np.array([*READY, *READY], dtype=np.float32), "joint", lambda snapshot: False)
    return world


def measure(rounds: int) -> dict[str, object]:
    """All figures of one run."""
    spec = PolicySpec("benchmark")
    worlds = {"observation": open_world(), "bare": open_world(), "primitives": open_world()}
    first, _ = timed(lambda: worlds["observation"].observe(spec))
    sides: dict[str, Callable[[], Any]] = {
        "observation": lambda: worlds["observation"].observe(spec)
    }
    for name in ("bare", "primitives"):
        worlds[name].observe(spec)
        scene, cameras = bare_cameras(worlds[name])
        if name == "primitives":
            studio = worlds[name]._studio
            assert studio is not None
            for links in studio._robot:
                for entity in links.values():
                    scene.remove_entity(entity)
        sides[name] = partial(capture, scene, cameras)
    costs: dict[str, list[tuple[float, float]]] = {name: [] for name in sides}
    for run in sides.values():
        run()
    for _ in range(rounds):
        for name, run in sides.items():
            costs[name].append(timed(run))
    return {
        "benchmark": "rendering",
        "first_picture_ms": round(first, 1),
        "wall_ms": {n: round(statistics.median(w for w, _ in c), 1) for n, c in costs.items()},
        "fastest_wall_ms": {n: round(min(w for w, _ in c), 1) for n, c in costs.items()},
        "cpu_ms": {n: round(statistics.median(p for _, p in c), 1) for n, c in costs.items()},
        "bar_ms": BAR_MS,
        "machine": {
            "cores": os.cpu_count(),
            "load": round(os.getloadavg()[0], 1),
            "python": platform.python_version(),
            **versions(),
            "renderer": worlds["observation"].info()["renderer"],
        },
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=15)
    print(json.dumps(measure(parser.parse_args().rounds), indent=2))


if __name__ == "__main__":
    main()
