"""A camera's pictures as they are kept: one film, or a still for every frame.

The bytes follow from the pictures and from the versions of the encoders: one thread, no time of
day. Frame t of an episode's film lies at t / FPS seconds. Films have two frames a group and none
refers to later ones, so they are joined by copying the coded pictures and moving their times.
"""

import io
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from robospa.extras import need
from robospa.harness.datasets.episode import FILM_CODECS, STILL_CODECS, Pictures
from robospa.harness.datasets.statistics import ColourHistogram
from robospa.observation import CameraSpec

SAMPLED = 16
"""Pictures of an episode and camera that go into the statistics. LeRobot takes a hundred and more;
a data set has thousands of episodes, so these are plenty."""
FPS = 17
"""Frames per second that a data set names: frames are mostly 15 physics steps of 1/250 s apart,
which is 16.67 Hz, and LeRobot takes whole numbers only. Motions end between, so frames are not
equally far apart in any case; `DatasetEpisode.sim_time` has their times."""


class EpisodeFilmError(Exception):
    """A film cannot be joined to others, or is not as long as its episode."""


class JoinedFilm:
    """An MP4 file at `path` that grows episode by episode."""

    def __init__(self, path: Path) -> None:
        import av

        path.parent.mkdir(parents=True, exist_ok=True)
        self._file: Any = av.open(str(path), "w", format="mp4", options={"movflags": "faststart"})
        self._stream: Any = None
        self._settings: bytes | None = None
        self.frames, self.size = 0, 0

    @property
    def seconds(self) -> float:
        """Its length until now [s]."""
        return self.frames / FPS

    def append(self, data: bytes, frames: int) -> None:
        """Add the film `data` of so many `frames`; raises EpisodeFilmError."""
        with _opened(data) as film:
            source = film.streams.video[0]
            settings = bytes(source.codec_context.extradata or b"")
            if self._stream is None:
                self._stream = self._file.add_stream_from_template(source, opaque=True)
                self._stream.time_base = source.time_base
                self._settings = settings
            if settings != self._settings:
                raise EpisodeFilmError(
                    "its film was encoded with other settings than those before it"
                )
            step = Fraction(1, FPS) / source.time_base
            for packet in _packets(film, frames):
                packet.pts = packet.dts = int(self.frames * step)
                packet.duration = int(step)
                packet.stream = self._stream
                self.size += packet.size
                self.frames += 1
                self._file.mux(packet)

    def close(self) -> None:
        """Finish the file."""
        self._file.close()


def frame_count(path: Path) -> int:
    """Number of frames of a film; raises OSError or ValueError if it is none."""
    import av

    film: Any
    with av.open(str(path)) as film:
        return sum(packet.dts is not None for packet in film.demux(film.streams.video[0]))


def check_film(data: bytes, frames: int) -> None:
    """Raises EpisodeFilmError unless the film has so many `frames`, each at its time."""
    with _opened(data) as film:
        for _ in _packets(film, frames):
            pass


def _packets(film: Any, frames: int) -> Iterator[Any]:
    """The coded pictures of a film, which must be `frames` in the order and at the times in which
    they are shown."""
    source = film.streams.video[0]
    step, count = Fraction(1, FPS) / source.time_base, 0
    for packet in film.demux(source):
        if packet.dts is None:
            continue
        if packet.pts != count * step or packet.dts != packet.pts:
            raise EpisodeFilmError(f"frame {count} of its film is not shown at {count}/{FPS} s")
        count += 1
        yield packet
    if count != frames:
        raise EpisodeFilmError(f"its film has {count} frames, and the episode {frames}")


def film_frames(data: bytes, wanted: int | None = None) -> Iterator[NDArray[np.uint8]]:
    """All frames of a film as uint8 (height, width, 3) RGB; or about `wanted` of them, evenly
    spread, each one that can be decoded without another (a key frame)."""
    with _opened(data) as film:
        stream = film.streams.video[0]
        if wanted is None:
            for frame in film.decode(stream):
                yield frame.to_ndarray(format="rgb24")
            return
        keys = [packet for packet in film.demux(stream) if packet.is_keyframe and packet.size]
        for place in np.unique(np.linspace(0, len(keys) - 1, wanted).round().astype(int)):
            coder = stream.codec_context
            decoded = [*coder.decode(keys[place]), *coder.decode(None)]
            coder.flush_buffers()
            yield decoded[0].to_ndarray(format="rgb24")


def _opened(data: bytes) -> Any:
    import av

    return av.open(io.BytesIO(data))


CODECS = (*FILM_CODECS, *STILL_CODECS)
JPEG_QUALITY = 95
"""OpenCV's default, which the official recordings have."""

Picture = NDArray[np.uint8]


class CodecMissing(Exception):
    """PyAV has no such encoder here; the message says what to do."""


ENCODERS: Mapping[str, tuple[str, Mapping[str, str]]] = {
    "h264": (
        "libx264",
        {"crf": "27", "preset": "veryfast", "g": "2", "bf": "0", "rc-lookahead": "0"},
    ),
    "av1": ("libsvtav1", {"crf": "30", "preset": "12", "g": "2", "svtav1-params": "lp=1"}),
}
"""Encoders of PyAV and their options: AV1 as LeRobot encodes it by default; H.264 as most players
and loaders read it fast.

libx264 that looks ahead gives the same pictures other bytes in 1 of 130 films of 30 frames, even on
one thread; without, in none of 4,000. Quality 27 has then the error that 23 had."""


class FilmSink:
    """An MP4 file of `camera` in memory; frame t is shown at t / FPS seconds."""

    def __init__(self, camera: CameraSpec, codec: str) -> None:
        import av

        os.environ.setdefault("SVT_LOG", "1")  # else the AV1 encoder prints its settings
        self._av = av
        self._bytes = io.BytesIO()
        self._file = cast(Any, av.open(self._bytes, "w", format="mp4"))
        encoder, options = ENCODERS[codec]
        self._stream = self._file.add_stream(encoder, rate=FPS)
        self._stream.height, self._stream.width = camera.height, camera.width
        self._stream.pix_fmt, self._stream.options = "yuv420p", dict(options)
        self._stream.codec_context.thread_count = 1
        self._stream.time_base = Fraction(1, FPS)
        self._frames = 0

    def add(self, image: Picture) -> None:
        """Append an RGB picture (height, width, 3)."""
        packed = np.ascontiguousarray(image)  # the encoder reads it before this returns
        frame = self._av.VideoFrame.from_numpy_buffer(packed, format="rgb24")
        frame.pts, frame.time_base = self._frames, Fraction(1, FPS)
        self._frames += 1
        self._file.mux(self._stream.encode(frame))

    def finish(self) -> bytes:
        """The whole film."""
        self._file.mux(self._stream.encode())
        self._file.close()
        return self._bytes.getvalue()


def _file_of(image: Picture, codec: str) -> bytes:
    """A file of the RGB picture (height, width, 3)."""
    from PIL import Image

    stream = io.BytesIO()
    options = {"compress_level": 6} if codec == "png" else {"quality": JPEG_QUALITY}
    Image.fromarray(np.ascontiguousarray(image)).save(stream, codec, **options)
    return stream.getvalue()


def encode(
    frames: Iterable[Sequence[Picture]], cameras: Sequence[CameraSpec], codec: str
) -> dict[str, Pictures]:
    """The pictures of all `frames`, of which each has one for every camera, by camera.

    Raises what `require` does.
    """
    if not cameras:
        return {}
    require(codec)
    if codec in FILM_CODECS:
        films = [FilmSink(camera, codec) for camera in cameras]
        for images in frames:
            for film, image in zip(films, images, strict=True):
                film.add(image)
        files = [(film.finish(),) for film in films]
    else:
        stills = ([_file_of(image, codec) for image in row] for row in frames)
        files = list(zip(*stills, strict=True))
    return {
        camera.name: Pictures(codec, camera.width, camera.height, of)
        for camera, of in zip(cameras, files, strict=True)
    }


def require(codec: str) -> None:
    """Raises MissingPackage or CodecMissing if pictures cannot be encoded so here."""
    if codec in STILL_CODECS:
        need("PIL", "demos")
        return
    av = need("av", "demos")
    if (encoder := ENCODERS[codec][0]) not in av.codecs_available:
        others = " or ".join(name for name in CODECS if name != codec)
        raise CodecMissing(f"PyAV {av.__version__} has no encoder {encoder} here: choose {others}")


def colours(seen: Pictures) -> ColourHistogram:
    """The colours of about `SAMPLED` evenly spread pictures."""
    found = ColourHistogram()
    if seen.filmed:
        some = film_frames(seen.files[0], SAMPLED)
    else:
        places = np.linspace(0, len(seen.files) - 1, SAMPLED).round().astype(int)
        some = (_still(seen.files[t]) for t in np.unique(places).tolist())
    for picture in some:
        found.add(picture)
    return found


def _still(data: bytes) -> Picture:
    """The picture in a file, uint8 (height, width, 3) RGB."""
    from PIL import Image

    with Image.open(io.BytesIO(data)) as picture:
        return np.asarray(picture.convert("RGB"))


def all_pictures(seen: Pictures) -> Iterator[Picture]:
    """All frames, uint8 (height, width, 3) RGB."""
    return film_frames(seen.files[0]) if seen.filmed else map(_still, seen.files)
