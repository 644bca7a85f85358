"""Checks of what a machine needs to simulate and to draw, each with the one thing to do.

Every check runs in a process of its own with a time limit: a broken driver may end or hang the
process that asks it, and this is here to say so.
"""

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from robospa.harness.pool import JobProcess, WorkerDied
from robospa.harness.running.atomic_file import log_to
from robospa.harness.running.manifest import this_processor

SETUP = "run `make install` in the repository (it installs what is missing)"
DRIVER = (
    "install a Vulkan driver: `sudo apt-get install mesa-vulkan-drivers` (Mesa 24.3 or newer; on "
    "Debian 12 from bookworm-backports), or `make install`, which does it"
)
TIME_LIMIT = 120.0
"""[s] for one check; the first picture of a machine takes a few seconds in software."""


@dataclass(frozen=True)
class SystemCheck:
    """One finding: `fix` is the one thing to do, empty if `ok`."""

    name: str
    ok: bool
    detail: str
    fix: str = ""


def run_checks() -> Iterator[SystemCheck]:
    """All checks, in the order in which they build on each other, as they are done.

    After a failed "simulator" check the ones that need it are left out.
    """
    processor = this_processor()
    yield SystemCheck("processor", True, f"{processor.name or 'unnamed'}, {processor}")
    simulator = _run("simulator", check_simulator, SETUP)
    yield simulator
    if simulator.ok:
        yield _run("physics", check_physics, SETUP)
    device = _run("vulkan device", check_device, DRIVER)
    yield device
    if simulator.ok and device.ok:
        yield _run("first picture", check_picture, DRIVER)


def _run(name: str, check: Callable[[], str], fix: str) -> SystemCheck:
    """What `check` says in a child process, or why it failed."""
    worker = JobProcess(quiet, check, seconds=TIME_LIMIT, name="check")
    try:
        return SystemCheck(name, True, worker.run(None))
    except WorkerDied as error:
        return SystemCheck(name, False, f"the check itself broke: {error}", fix)
    except Exception as error:  # whatever it is, the reader wants to see it
        return SystemCheck(name, False, f"{type(error).__name__}: {error}", fix)
    finally:
        worker.kill()


def quiet(check: Callable[[], str]) -> Callable[[None], str]:
    """What runs `check` in its process, whose libraries print nothing."""
    log_to(Path(os.devnull))
    return lambda _: check()


def check_simulator() -> str:
    """SAPIEN can be imported; its versions."""
    import sapien

    return f"SAPIEN {sapien.__version__}, PhysX {sapien.physx.version()}"


def check_device() -> str:
    """There is a Vulkan device, with a driver that SAPIEN starts on; raises VulkanError if not."""
    from robospa.harness.sim.vulkan import OLDEST_MESA, VulkanError, devices

    found = devices()
    usable = [device for device in found if not device.too_old]
    if not usable:
        seen = ", ".join(f"{d.name} with {d.version}" for d in found) or "no device"
        oldest = ".".join(map(str, OLDEST_MESA))
        raise VulkanError(f"found {seen}; SAPIEN needs a GPU or Mesa {oldest} or newer")
    return "; ".join(f"{d.name}, {d.version}" for d in usable)


def check_physics() -> str:
    """A cube falls one second and lies where it should; raises RuntimeError if not."""
    import sapien
    from sapien import physx

    system = physx.PhysxCpuSystem()
    system.timestep = 1 / 250
    scene = sapien.Scene([system])
    scene.add_ground(0.0, render=False)
    builder = scene.create_actor_builder()
    builder.add_box_collision(half_size=[0.1, 0.1, 0.1])
    builder.set_initial_pose(sapien.Pose([0.0, 0.0, 0.5]))
    cube = builder.build(name="cube")
    began = time.perf_counter()
    for _ in range(250):
        system.step()
    took = time.perf_counter() - began
    height = float(cube.pose.p[2])
    if abs(height - 0.1) > 1e-3:
        raise RuntimeError(f"a cube of 0.2 m came to rest at height {height:.4f} m, not 0.1 m")
    return f"one second of a falling cube in {took * 1e3:.0f} ms"


def check_picture() -> str:
    """A red cube is red in the picture; raises RuntimeError if not."""
    import numpy as np
    import sapien

    from robospa.harness.sim.cameras import new_camera, pixels

    began = time.perf_counter()
    system = sapien.render.RenderSystem()
    scene = sapien.Scene([system])
    scene.set_ambient_light([1.0, 1.0, 1.0])
    scene.add_directional_light([1.0, 0.0, 0.0], [0.5, 0.5, 0.5], shadow=True)
    builder = scene.create_actor_builder()
    builder.add_box_visual(
        half_size=[0.2, 0.2, 0.2],
        material=sapien.render.RenderMaterial(base_color=[1.0, 0.0, 0.0, 1.0]),
    )
    entity = sapien.Entity()
    entity.add_component(builder.build_render_component())
    entity.pose = sapien.Pose([1.0, 0.0, 0.0])
    scene.add_entity(entity)
    camera = new_camera(scene, 32, 24)
    scene.update_render()
    camera.take_picture()
    red, green, blue = pixels(camera, np.zeros(3, np.uint8))[0][12, 16].tolist()
    took = time.perf_counter() - began
    if not (red > 127 and green < 51 and blue < 51):
        raise RuntimeError(f"a red cube has colour ({red}, {green}, {blue})")
    return f"32x24 on {system.device.name}, drawn {took:.1f} s after the start"
