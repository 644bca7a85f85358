"""The machine's Vulkan devices and their drivers, queried without SAPIEN.

SAPIEN does not tell a driver's version, and the version decides: software rendering needs Mesa 24.3
or newer. So the loader is asked directly (ctypes, a handful of calls). Asking can end the process
if a driver is broken; `robospa.harness.machine_check` asks from a child process.
"""

import ctypes
import ctypes.util
import re
import struct
from dataclasses import dataclass
from pathlib import Path

OLDEST_MESA = (24, 3)
"""SAPIEN does not start on the software device of an older Mesa."""

_API_1_2 = (1 << 22) | (2 << 12)
_CREATE_INSTANCE = 1
_PROPERTIES_2 = 1000059001
_DRIVER_PROPERTIES = 1000196000


class VulkanError(Exception):
    """No loader, no driver or a call that failed; the message says which."""


@dataclass(frozen=True)
class Device:
    """`driver` as in "llvmpipe", `version` in the driver's own words: "Mesa 25.0.7"."""

    name: str
    driver: str
    version: str

    @property
    def too_old(self) -> bool:
        """True for a software device that SAPIEN is known not to start on."""
        found = re.search(r"Mesa (\d+)\.(\d+)", self.version)
        if self.driver != "llvmpipe" or not found:
            return False
        return (int(found[1]), int(found[2])) < OLDEST_MESA


_APPLICATION, _INSTANCE = struct.Struct("@iPPIPII"), struct.Struct("@iPIPIPIP")
_PROPERTIES, _DRIVER = struct.Struct("@iP5I256s1024x"), struct.Struct("@iPI256s256s4x")
"""The C structures, as native alignment lays them out; of the properties' limits only the room."""


def _loader() -> ctypes.CDLL:
    """The Vulkan loader: the system's, else the one that SAPIEN brings along."""
    candidates = [ctypes.util.find_library("vulkan") or "libvulkan.so.1"]
    try:
        import sapien

        folder = Path(sapien.__file__).parent / "vulkan_library"
        candidates += [str(path) for path in sorted(folder.glob("libvulkan.so*"))]
    except ImportError:
        pass
    for name in candidates:
        try:
            return ctypes.CDLL(name)
        except OSError:
            continue
    raise VulkanError("there is no Vulkan loader (libvulkan.so.1)")


def devices() -> tuple[Device, ...]:
    """All Vulkan devices in the loader's order; VulkanError if it has no driver at all."""
    vulkan = _loader()
    name = ctypes.create_string_buffer(b"robospa")
    application = ctypes.create_string_buffer(
        _APPLICATION.pack(0, 0, ctypes.addressof(name), 1, 0, 0, _API_1_2)
    )
    at = ctypes.addressof(application)
    wanted = ctypes.create_string_buffer(_INSTANCE.pack(_CREATE_INSTANCE, 0, 0, at, 0, 0, 0, 0))
    instance = ctypes.c_void_p()
    code = vulkan.vkCreateInstance(wanted, None, ctypes.byref(instance))
    if code != 0:
        raise VulkanError(f"there is no Vulkan driver (vkCreateInstance answers {code})")
    try:
        count = ctypes.c_uint32()
        vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), None)
        handles = (ctypes.c_void_p * count.value)()
        vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), handles)
        return tuple(_describe(vulkan, ctypes.c_void_p(handle)) for handle in handles)
    finally:
        vulkan.vkDestroyInstance(instance, None)


def _describe(vulkan: ctypes.CDLL, handle: ctypes.c_void_p) -> Device:
    driver = ctypes.create_string_buffer(_DRIVER.pack(_DRIVER_PROPERTIES, 0, 0, b"", b""))
    asked = _PROPERTIES.pack(_PROPERTIES_2, ctypes.addressof(driver), *[0] * 5, b"")
    properties = ctypes.create_string_buffer(asked)
    vulkan.vkGetPhysicalDeviceProperties2(handle, properties)
    texts = _PROPERTIES.unpack_from(properties)[-1], *_DRIVER.unpack_from(driver)[-2:]
    return Device(*(text.partition(b"\0")[0].decode(errors="replace") for text in texts))
