"""Builds the wheels and the sdist of a release into dist/ and tries them; `make wheels` calls it.

python releases/wheels.py [--targets x86_64,aarch64] [--pythons 3.11,3.12,3.13] [--only-try]

Wheels are abi3: one for each kind of processor, for all versions of Python. maturin builds them with zig as the linker
(both from PyPI), so that they run wherever glibc is 2.17 or later. Each wheel for this machine and the sdist are
installed in fresh environments; there they drive a scenario, repeat it, and write a report. On a processor without
AVX2, which qemu-x86_64 imitates where it is installed (apt: qemu-user), the digest must be the same.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
DIST, UV = ROOT / "dist", ROOT / ".uv" / "bin" / "uv"
SIZE_MAX = 8_000_000  # bytes
#: A processor without AVX2 that numpy's wheels still run on.
OLD_PROCESSOR = "Nehalem"


def done(*words: object, cwd: Path = ROOT, **environment: str) -> str:
    """Runs a command and returns what it prints; ends with its output if it fails."""
    words = tuple(map(str, words))
    found = subprocess.run(
        words, cwd=cwd, env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
    if found.returncode:
        sys.exit(f"{' '.join(words)}\nexit code {found.returncode}\n{found.stdout}\n{found.stderr}")
    return found.stdout


def build(processors: list[str]) -> None:
    """Wheels and sdist."""
    shutil.rmtree(DIST, ignore_errors=True)
    installed = done("rustup", "target", "list", "--installed").split()
    for processor in processors:
        target = f"{processor}-unknown-linux-gnu"
        if target not in installed:
            done("rustup", "target", "add", target)
        # maturin looks for zig in the active environment and on the path, which may be those of another one.
        done(sys.executable, "-m", "maturin", "build", "--release", "--zig", "--compatibility", "manylinux2014",
             "--target", target, "--out", DIST, VIRTUAL_ENV=sys.prefix,
             PATH=f"{sys.prefix}/bin{os.pathsep}{os.environ['PATH']}")  # fmt: skip
    done(sys.executable, "-m", "maturin", "sdist", "--out", DIST)


def inspect(wheel: Path) -> None:
    """Its size, and what must lie in it."""
    size, names = wheel.stat().st_size, zipfile.ZipFile(wheel).namelist()
    print(f"{wheel.name}: {size / 1e6:.1f} MB, {len(names)} files")
    if size > SIZE_MAX:
        sys.exit(f"{wheel.name}: more than {SIZE_MAX / 1e6:g} MB")
    for wanted in ("licenses/LICENSE", "licenses/LICENSES-RUST.txt", "py.typed", "bundle", "data/t_junction.xml"):
        if not any(wanted in name for name in names):
            sys.exit(f"{wheel.name}: holds no {wanted}")


def tried(package: Path, python: str, place: Path) -> tuple[str, Path] | None:
    """Installs into a fresh environment and drives, repeats, reports; the digest and the interpreter, None without."""
    environment = place / f"{python}-{'sdist' if package.suffix == '.gz' else 'wheel'}"
    # Outside of a checkout and without git: a package may not need either.
    made = subprocess.run(
        [str(UV), "venv", "-q", "--python", python, str(environment)], capture_output=True, text=True, check=False
    )
    if made.returncode:
        print(f"Python {python}: cannot be had here: {made.stderr.strip().splitlines()[-1]}")
        return None
    own = environment / "bin" / "python"
    done(UV, "pip", "install", "-q", "--python", own, package, cwd=place)
    folder = environment / "run"
    done(own, "-m", "interdrive", "run", "t_junction", "--agents", "all", "--out", folder, "--quiet", cwd=place)
    verified = done(own, "-m", "interdrive", "verify", folder, cwd=place)
    if not verified.startswith("equal:"):
        sys.exit(verified)
    done(own, "-m", "interdrive", "report", folder, cwd=place)
    if (folder / "report.html").stat().st_size < 100_000:
        sys.exit("the report is empty")
    digest = json.loads((folder / "run.json").read_text(encoding="utf-8"))["digest"]
    print(f"Python {python}, {package.name}: drives, repeats and reports; digest {digest[:12]}")
    return digest, own


def without_avx2(python: Path, place: Path) -> str | None:
    """The digest on a processor without AVX2; None where there is no qemu-x86_64."""
    qemu = shutil.which("qemu-x86_64")
    if qemu is None:
        print("without AVX2: not tried, qemu-x86_64 is missing (apt-get install qemu-user)")
        return None
    code = "import interdrive; print(interdrive.simulate('t_junction', agents='all', threads=1).digest)"
    own = python.resolve()
    packages = next(python.parents[1].glob("lib/python3*/site-packages"))
    return done(qemu, "-cpu", OLD_PROCESSOR, own, "-c", code, cwd=place, PYTHONPATH=str(packages)).strip()


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--targets", default="x86_64,aarch64")
    parser.add_argument("--pythons", default="3.11,3.12,3.13")
    parser.add_argument("--only-try", action="store_true", help="what lies in dist/ already")
    arguments = parser.parse_args()
    if not arguments.only_try:
        build(arguments.targets.split(","))
    for wheel in sorted(DIST.glob("*.whl")):
        inspect(wheel)
    with tempfile.TemporaryDirectory() as made:
        place = Path(made)
        (wheel,) = DIST.glob(f"*{platform.machine()}.whl")
        found = [one for python in arguments.pythons.split(",") if (one := tried(wheel, python, place))]
        (sdist,) = DIST.glob("*.tar.gz")
        found.append(tried(sdist, arguments.pythons.split(",")[0], place) or sys.exit("the sdist was not tried"))
        digests = {digest for digest, _ in found}
        if (old := without_avx2(found[0][1], place)) is not None:
            print(f"without AVX2 ({OLD_PROCESSOR}): digest {old[:12]}")
            digests.add(old)
        if len(digests) != 1:
            sys.exit(f"digests differ: {', '.join(sorted(digests))}")


if __name__ == "__main__":
    main()
