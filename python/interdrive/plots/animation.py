"""A run as a film: GIF through Pillow, MP4 through ffmpeg."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import IO, TYPE_CHECKING

import numpy as np
from PIL import Image

from interdrive.errors import InputError, MissingExtraError, ResultsError
from interdrive.plots.frames import Stage
from interdrive.storage import replacing

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from interdrive.plots.view import View
    from interdrive.run import RunRecord

#: The last frame stays for this long [s].
_HOLD = 2.0


def check_animation(path: str | Path) -> None:
    """Refuses a `path` to which no film can be written; useful before a long simulation.

    Raises:
        ResultsError: The ending is neither .gif nor .mp4.
        MissingExtraError: MP4 without ffmpeg.
    """
    kind = Path(path).suffix.lower()
    if kind not in (".gif", ".mp4"):
        raise ResultsError(f"{path}: films end in .gif or .mp4")
    if kind == ".mp4" and shutil.which("ffmpeg") is None:
        raise MissingExtraError(f"{path}: MP4 needs ffmpeg, which is not on the PATH; .gif works without")


def animate_run(
    run: RunRecord,
    path: str | Path,
    *,
    fps: float = 10.0,
    on_frame: Callable[[int, int], None] | None = None,
    view: View | None = None,
) -> None:
    """Writes a film of the run in real time, whole or not at all.

    Agents have colours and ids, recorded traffic is grey, a coloured line is an agent's chosen plan. Amber marks at two
    corners of an agent are its blinkers. An agent that is done leaves the marker of its outcome; a collision stays
    marked.

    Args:
        run: Finished or interrupted.
        path: Ends in .gif or .mp4 (needs ffmpeg).
        fps: Frames per second, at most one per time step.
        on_frame: Called after every frame with the number of frames done and in all.
        view: What is shown; None: where the agents move.

    Raises:
        InputError: fps is not positive.
        ResultsError: The file cannot be written.
        MissingExtraError: MP4 without ffmpeg.
    """
    check_animation(path)
    if not fps > 0:
        raise InputError(f"fps must be positive, not {fps}")
    stage = Stage(run, view=view)
    rate = min(fps, 1.0 / run.scenario.dt)
    n_frames = max(1, round((run.states.n_steps - 1) * run.scenario.dt * rate) + 1)
    columns = [min(run.states.n_steps - 1, round(k / rate / run.scenario.dt)) for k in range(n_frames)]
    with replacing(path) as partial:
        if partial.suffix.lower() == ".gif":
            _write_gif(stage, columns, 1.0 / rate, partial, on_frame)
        else:
            _write_mp4(stage, columns, rate, partial, on_frame)


def _write_gif(
    stage: Stage, columns: list[int], seconds: float, path: Path, on_frame: Callable[[int, int], None] | None
) -> None:
    # One palette for all frames, from a few of them: no flicker, and still areas cost nothing.
    samples = [stage.frame(columns[i]) for i in np.linspace(0, len(columns) - 1, 5).astype(int)]
    mosaic = Image.new("RGB", (samples[0].width, sum(sample.height for sample in samples)))
    for index, sample in enumerate(samples):
        mosaic.paste(sample, (0, index * sample.height))
    palette = mosaic.quantize(255, method=Image.Quantize.MEDIANCUT)

    def frames() -> Iterator[Image.Image]:
        for done, column in enumerate(columns, start=1):
            yield stage.frame(column).quantize(palette=palette, dither=Image.Dither.NONE)
            if on_frame is not None:
                on_frame(done, len(columns))

    # GIF counts in hundredths of a second; viewers take less than two of them for ten.
    marks = np.round(np.arange(len(columns) + 1) * seconds * 100.0).astype(int)
    durations = (10 * np.maximum(np.diff(marks), 2)).tolist()
    durations[-1] = int(1000 * _HOLD)
    every = frames()
    first = next(every)
    first.save(path, "GIF", save_all=True, append_images=every, duration=durations, loop=0, optimize=False)


def _write_mp4(
    stage: Stage, columns: list[int], rate: float, path: Path, on_frame: Callable[[int, int], None] | None
) -> None:
    held = [*columns, *columns[-1:] * max(1, round(_HOLD * rate))]
    size = f"{stage.size[0]}x{stage.size[1]}"
    command = [
        "ffmpeg",
        "-loglevel",
        "error",
        "-y",
        "-f",
        "rawvideo",
        "-pix_fmt",
        "rgb24",
        "-s",
        size,
        "-r",
        f"{rate:g}",
    ]
    command += ["-i", "-", "-an", "-vcodec", "libx264", "-pix_fmt", "yuv420p", "-crf", "18", str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stderr is not None
        try:
            _feed(process.stdin, stage, held, on_frame)
        except BrokenPipeError:
            pass  # ffmpeg says why, below
        except BaseException:
            process.kill()
            raise
        complaint = process.stderr.read().decode(errors="replace").split("\n")[0]
    if process.returncode:
        raise OSError(f"ffmpeg failed: {complaint or f'exit code {process.returncode}'}")


def _feed(pipe: IO[bytes], stage: Stage, columns: list[int], on_frame: Callable[[int, int], None] | None) -> None:
    with pipe:
        for done, column in enumerate(columns, start=1):
            pipe.write(stage.frame(column).tobytes())
            if on_frame is not None:
                on_frame(done, len(columns))
