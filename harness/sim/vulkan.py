"""The machine's Vulkan devices and their drivers, queried without SAPIEN.

SAPIEN does not tell a driver's version, and the version decides: software rendering needs Mesa 24.3
or newer. So the loader is asked directly (ctypes, a handful of calls). Asking can end the process
if a driver is broken; `robospa.harness.machine_check` asks from a child process.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import re
from dataclasses import asdict, dataclass
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

    def to_json(self) -> dict[str, str]:
        """Plain JSON values."""
        return asdict(self)

    @property
    def too_old(self) -> bool:
        """True for a software device that SAPIEN is known not to start on."""
        found = re.search(r"Mesa (\d+)\.(\d+)", self.version)
        if self.driver != "llvmpipe" or not found:
            return False
        return (int(found[1]), int(found[2])) < OLDEST_MESA


class _Instance(ctypes.Structure):
    _fields_ = (
        ("sType", ctypes.c_uint32),
        ("pNext", ctypes.c_void_p),
        ("flags", ctypes.c_uint32),
        ("application", ctypes.c_void_p),
        ("layerCount", ctypes.c_uint32),
        ("layers", ctypes.c_void_p),
        ("extensionCount", ctypes.c_uint32),
        ("extensions", ctypes.c_void_p),
    )


class _Application(ctypes.Structure):
    _fields_ = (
        ("sType", ctypes.c_uint32),
        ("pNext", ctypes.c_void_p),
        ("name", ctypes.c_char_p),
        ("version", ctypes.c_uint32),
        ("engine", ctypes.c_char_p),
        ("engineVersion", ctypes.c_uint32),
        ("api", ctypes.c_uint32),
    )


class _Driver(ctypes.Structure):
    _fields_ = (
        ("sType", ctypes.c_uint32),
        ("pNext", ctypes.c_void_p),
        ("id", ctypes.c_uint32),
        ("name", ctypes.c_char * 256),
        ("info", ctypes.c_char * 256),
        ("conformance", ctypes.c_uint8 * 4),
    )


class _Properties(ctypes.Structure):
    _fields_ = (
        ("sType", ctypes.c_uint32),
        ("pNext", ctypes.c_void_p),
        ("numbers", ctypes.c_uint32 * 5),
        ("name", ctypes.c_char * 256),
        ("rest", ctypes.c_uint8 * 1024),  # limits and more, 540 bytes; room to spare
    )


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
    application = _Application(0, None, b"robospa", 1, b"", 0, _API_1_2)
    wanted = _Instance(_CREATE_INSTANCE, None, 0, ctypes.addressof(application), 0, None, 0, None)
    instance = ctypes.c_void_p()
    code = vulkan.vkCreateInstance(ctypes.byref(wanted), None, ctypes.byref(instance))
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
    driver = _Driver(_DRIVER_PROPERTIES, None)
    properties = _Properties(_PROPERTIES_2, ctypes.addressof(driver))
    vulkan.vkGetPhysicalDeviceProperties2(handle, ctypes.byref(properties))
    return Device(
        name=properties.name.decode(errors="replace"),
        driver=driver.name.decode(errors="replace"),
        version=driver.info.decode(errors="replace"),
    )
