"""The OpenGL context, by EGL or OSMesa. Nothing else in the project uses PYOPENGL_PLATFORM.

PyOpenGL binds all functions to one platform when it is first imported, so a process has EGL or OSMesa, never both. It has one
context, which all its renderers share, and which is never closed: EGL has one connection to a device, and a renderer that closes it
(as pyrender's own do) destroys the contexts of the others.
"""

import ctypes
import importlib
import os
import sys
import threading
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import UInt8

from tussock.world.errors import MissingDependencyError, SettingError

# Libraries that must load (any one of each group), and the Debian packages that contain them.
_LIBRARIES = {
    "egl": ((("libEGL.so.1",), ("libOpenGL.so.0", "libGL.so.1")), "libegl1 libgl1 libgl1-mesa-dri"),
    "osmesa": ((("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"),), "libosmesa6"),
}
_PLATFORMS = {"EGLPlatform": "egl", "OSMesaPlatform": "osmesa", "GLXPlatform": "glx"}

_opening = threading.Lock()
# One for the process, as PyOpenGL's platform is. It is opened by `open_context` only.
_context: "Context | None" = None


class Context:
    """The OpenGL context of the process. `with context:` makes it current, in one thread at a time.

    Args:
        backend: "egl" or "osmesa".

    Raises:
        MissingDependencyError: The driver is missing or too old.
    """

    def __init__(self, backend: str):
        self.backend = backend
        self._lock = threading.RLock()
        self._depth = 0
        self._make_current, self._release = _egl_context() if backend == "egl" else _osmesa_context()
        from OpenGL.GL.ARB.clip_control import glClipControl

        with self:
            if not glClipControl:
                raise MissingDependencyError(
                    f"the {backend} renderer needs OpenGL 4.5 or GL_ARB_clip_control, which this driver does not have; "
                    f"update the driver or use the cpu renderer"
                )

    def __enter__(self) -> "Context":
        self._lock.acquire()
        try:
            if self._depth == 0:
                self._make_current()
        except BaseException:  # also Ctrl-C: other threads must not wait for ever
            self._lock.release()
            raise
        self._depth += 1
        return self

    def __exit__(self, *_: object) -> None:
        self._depth -= 1
        if self._depth == 0:
            self._release()
        self._lock.release()


def open_context(backend: str) -> Context:
    """The context of the process, which the first call opens.

    Args:
        backend: "egl" or "osmesa".

    Raises:
        SettingError: The process is bound to the other backend.
        MissingDependencyError: A library or driver is missing.
    """
    global _context
    with _opening:
        if bound_backend() not in (None, backend):
            raise SettingError(
                f"the {backend} renderer cannot be opened: this process already uses OpenGL through {bound_backend()}, "
                f"and PyOpenGL has one of them in each process; open it in another process"
            )
        if _context is None:
            _check_libraries(backend)
            _bind(backend)
            _context = Context(backend)
        return _context


def bound_backend() -> str | None:
    """The platform that PyOpenGL is bound to in this process ("egl", "osmesa", "glx", ...); None if it is not loaded yet."""
    loaded = sys.modules.get("OpenGL.platform")
    platform = type(getattr(loaded, "PLATFORM", None)).__name__
    return None if loaded is None else _PLATFORMS.get(platform, platform)


def gl_device_name() -> str:
    """What OpenGL draws with (GL_RENDERER). Raises SettingError if no OpenGL renderer was opened in this process."""
    if _context is None:
        raise SettingError("no OpenGL renderer was opened in this process; open one first")
    from OpenGL import GL

    with _context:
        name: Any = GL.glGetString(GL.GL_RENDERER)
    return name.decode()


class Framebuffer:
    """An image to draw into: RGBA bytes, one sample for each pixel, and a float depth. The context must be current.

    Args:
        width: Pixels.
        height: Pixels.

    Raises:
        SettingError: OpenGL has no images of this size here.
    """

    def __init__(self, width: int, height: int):
        from OpenGL import GL

        limit = int(GL.glGetIntegerv(GL.GL_MAX_RENDERBUFFER_SIZE))
        if max(width, height) > limit:
            raise SettingError(
                f"cube faces of {width} pixels need an image of {width} x {height}, and this OpenGL draws at most {limit}; "
                f"use an eye with fewer pixels, a smaller face_size, or the cpu renderer"
            )
        self.width, self.height = width, height
        self._id = GL.glGenFramebuffers(1)
        self._buffers = GL.glGenRenderbuffers(2)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._id)
        kinds = ((GL.GL_RGBA8, GL.GL_COLOR_ATTACHMENT0), (GL.GL_DEPTH_COMPONENT32F, GL.GL_DEPTH_ATTACHMENT))
        for buffer, (kind, attachment) in zip(self._buffers, kinds, strict=True):
            GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
            GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, kind, width, height)
            GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, attachment, GL.GL_RENDERBUFFER, buffer)

    def select(self, size: int, bottom: int, rows: int, offset: int) -> None:
        """Choose where the next image (size x size) goes: its `rows` rows from `bottom` to row `offset`; the others are cut."""
        from OpenGL import GL
        from OpenGL.GL.ARB.clip_control import glClipControl

        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._id)
        GL.glViewport(0, offset - bottom, size, size)
        GL.glEnable(GL.GL_SCISSOR_TEST)
        GL.glScissor(0, offset, size, rows)
        # Depth goes from 1 near to 0 at infinity: floats are densest at 0, which keeps far surfaces apart.
        glClipControl(GL.GL_LOWER_LEFT, GL.GL_ZERO_TO_ONE)
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glDepthMask(GL.GL_TRUE)
        GL.glDepthFunc(GL.GL_GREATER)
        GL.glClearDepth(0.0)
        GL.glDisable(GL.GL_DITHER)

    def read(self, out: UInt8[np.ndarray, "height width 4"]) -> None:
        """Copy the image into `out`, bottom row first."""
        from OpenGL import GL

        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._id)
        GL.glReadPixels(0, 0, self.width, self.height, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE, array=out)

    def delete(self) -> None:
        """Free its memory."""
        from OpenGL import GL

        GL.glDeleteFramebuffers(1, [self._id])
        GL.glDeleteRenderbuffers(2, self._buffers)


def _check_libraries(backend: str) -> None:
    """Load the libraries of a backend. Raises MissingDependencyError with what to install."""
    groups, packages = _LIBRARIES[backend]
    for names in groups:
        if not any(_loads(name) for name in names):
            raise MissingDependencyError(
                f"the {backend} renderer needs {names[0]}, which is not on this machine; Debian: apt install {packages}"
            )


def _loads(name: str) -> bool:
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True


def _bind(backend: str) -> None:
    """Import PyOpenGL for a backend, without changing the environment."""
    before = os.environ.get("PYOPENGL_PLATFORM")
    os.environ["PYOPENGL_PLATFORM"] = backend
    try:
        importlib.import_module("OpenGL.platform")
    finally:
        del os.environ["PYOPENGL_PLATFORM"]
        if before is not None:
            os.environ["PYOPENGL_PLATFORM"] = before


def _egl_context() -> tuple[Any, Any]:
    """An OpenGL context without a surface, on the first EGL device that allows it, as functions (make current, release)."""
    from OpenGL import EGL
    from OpenGL.error import Error

    def make_current(display: Any, context: Any) -> None:
        EGL.eglBindAPI(EGL.EGL_OPENGL_API)  # each thread has its own choice
        EGL.eglMakeCurrent(display, EGL.EGL_NO_SURFACE, EGL.EGL_NO_SURFACE, context)

    displays = _egl_displays()
    for display in displays:
        try:
            context = _egl_context_on(display)
            make_current(display, context)
            return partial(make_current, display, context), partial(make_current, display, EGL.EGL_NO_CONTEXT)
        except Error:  # a device of another user, or one that cannot draw: the next one may work
            continue
    raise MissingDependencyError(
        f"the egl renderer needs a device with OpenGL 3.3, and none of the {len(displays)} devices here has it; install the "
        f"GPU's driver or, without a GPU, Mesa (Debian: apt install {_LIBRARIES['egl'][1]})"
    )


def _egl_displays() -> list[Any]:
    """One EGL display for each device; the default display where EGL cannot list them."""
    from OpenGL import EGL
    from OpenGL.EGL.EXT.device_enumeration import eglQueryDevicesEXT
    from OpenGL.EGL.EXT.platform_base import eglGetPlatformDisplayEXT
    from OpenGL.EGL.EXT.platform_device import EGL_PLATFORM_DEVICE_EXT

    if not eglQueryDevicesEXT:
        return [EGL.eglGetDisplay(EGL.EGL_DEFAULT_DISPLAY)]
    count = np.zeros(1, dtype=np.int32)
    devices = (EGL.EGLDeviceEXT * 32)()
    eglQueryDevicesEXT(32, devices, count)
    return [eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, device, None) for device in devices[: count[0]]]


def _egl_context_on(display: Any) -> Any:
    """A core OpenGL 3.3 context (what pyrender's shaders are written for) on a display. Raises EGLError."""
    from OpenGL import EGL

    EGL.eglInitialize(display, None, None)
    EGL.eglBindAPI(EGL.EGL_OPENGL_API)  # or the context is one of OpenGL ES
    config, count = (EGL.EGLConfig * 1)(), np.zeros(1, dtype=np.int32)
    pairs = (EGL.EGL_SURFACE_TYPE, EGL.EGL_PBUFFER_BIT), (EGL.EGL_RENDERABLE_TYPE, EGL.EGL_OPENGL_BIT)
    EGL.eglChooseConfig(display, np.array([*sum(pairs, ()), EGL.EGL_NONE], dtype=np.int32), config, 1, count)
    pairs = (
        (EGL.EGL_CONTEXT_MAJOR_VERSION, 3),
        (EGL.EGL_CONTEXT_MINOR_VERSION, 3),
        (EGL.EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL.EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT),
    )
    attributes = np.array([*sum(pairs, ()), EGL.EGL_NONE], dtype=np.int32)
    return EGL.eglCreateContext(display, config[0], EGL.EGL_NO_CONTEXT, attributes)


def _osmesa_context() -> tuple[Any, Any]:
    """An OSMesa context, as functions (make current, release)."""
    from OpenGL import GL, osmesa, platform

    # PyOpenGL returns the current context as a new object each time. pyrender takes it for another context, so it compiles its
    # shaders for every image and keeps them all. A plain address is equal to itself.
    platform.PLATFORM.GetCurrentContext.restype = ctypes.c_void_p  # type: ignore[attr-defined]

    pairs = (
        (osmesa.OSMESA_FORMAT, osmesa.OSMESA_RGBA),
        (osmesa.OSMESA_PROFILE, osmesa.OSMESA_CORE_PROFILE),
        (osmesa.OSMESA_CONTEXT_MAJOR_VERSION, 3),
        (osmesa.OSMESA_CONTEXT_MINOR_VERSION, 3),
    )
    context = osmesa.OSMesaCreateContextAttribs(np.array([*sum(pairs, ()), 0], dtype=np.int32), None)
    if not context:
        raise MissingDependencyError(
            "this OSMesa does not have OpenGL 3.3; install Mesa 17 or newer (Debian: apt install libosmesa6)"
        )
    unused = (ctypes.c_ubyte * 4)()  # OSMesa needs an image of its own; Framebuffer draws into another
    return (
        lambda: osmesa.OSMesaMakeCurrent(context, unused, GL.GL_UNSIGNED_BYTE, 1, 1),
        lambda: osmesa.OSMesaMakeCurrent(None, None, GL.GL_UNSIGNED_BYTE, 0, 0),
    )
