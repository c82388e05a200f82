"""Builds the image of the Dockerfile and drives a scenario in it; `make container` calls it.

python releases/container.py [--root DIR]

With a docker that answers it is `docker build` and `docker run`. Elsewhere the same steps run in an empty root:
debootstrap (apt: debootstrap) makes the base that FROM names, COPY copies, RUN runs in a chroot with the variables of
ENV. That needs the rights of root.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: What is tried: it drives, writes and repeats.
TRIALS = (("run", "t_junction", "--out", "out/first", "--quiet"), ("verify", "out/first"))
#: Files of the machine that name servers and certificates, which a container gets from docker.
_NETWORK = ("/etc/resolv.conf", "/etc/hosts", "/etc/pip.conf", "/etc/apt/apt.conf.d", "/etc/ssl/certs")
#: Variables that name certificates; in the root these lie where no package replaces them.
_CERTIFICATES = ("PIP_CERT", "SSL_CERT_FILE", "REQUESTS_CA_BUNDLE")
#: Variables that say how to reach package indexes.
_PASSED = ("PIP_", "SSL_", "HTTP", "http", "https", "no_proxy", "NO_PROXY", "REQUESTS_")


def steps_of(text: str) -> list[tuple[str, str]]:
    """The instructions of a Dockerfile, one per line, as (word, rest)."""
    lines = (line.strip() for line in text.splitlines())
    return [(word, rest) for word, _, rest in (line.partition(" ") for line in lines if line and line[0] != "#")]


def has_docker() -> bool:
    """Whether a docker is there and its server answers."""
    if shutil.which("docker") is None:
        return False
    return subprocess.run(["docker", "version"], capture_output=True, timeout=60, check=False).returncode == 0


def with_docker() -> None:
    """Builds the image, and tries it."""
    subprocess.run(["docker", "build", "--tag", "interdrive-trial", str(ROOT)], check=True)
    with tempfile.TemporaryDirectory() as folder:
        user = f"{os.getuid()}:{os.getgid()}"
        for trial in TRIALS:
            subprocess.run(
                ["docker", "run", "--rm", "--user", user, "--volume", f"{folder}:/work", "interdrive-trial", *trial],
                check=True,
            )


def in_root(root: Path, steps: list[tuple[str, str]]) -> None:
    """Does the steps in an empty root, and tries what they made."""
    variables = {name: value for name, value in os.environ.items() if name.startswith(_PASSED)}
    variables |= {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "HOME": "/root", "DEBIAN_FRONTEND": "noninteractive"}
    folder, command = "/", ["sh"]

    def run(*words: str) -> None:
        entered = [shutil.which("chroot") or "chroot", str(root), "/usr/bin/env", "--chdir", folder, *words]
        subprocess.run(entered, env=variables, check=True)

    for word, rest in steps:
        print(f"{word} {rest}", flush=True)
        if word == "FROM":
            _make_base(root, rest)
            for name in _CERTIFICATES:
                if (bundle := Path(variables.get(name, "/"))).is_file():
                    shutil.copyfile(bundle, root / "etc" / f"{name}.crt")
                    variables[name] = f"/etc/{name}.crt"
        elif word == "COPY":
            _copy(root, *rest.split())
        elif word == "RUN":
            run("sh", "-c", rest)
        elif word == "ENV":
            name, _, value = rest.partition("=")
            variables[name] = value
        elif word == "WORKDIR":
            folder = rest
            (root / rest.strip("/")).mkdir(parents=True, exist_ok=True)
        elif word == "ENTRYPOINT":
            command = json.loads(rest)
        else:
            sys.exit(f"{word}: this step is not known here")
    for trial in TRIALS:
        run(*command, *trial)


def _make_base(root: Path, image: str) -> None:
    """A Debian of that release, with what says how to reach servers."""
    name, _, tag = image.partition(":")
    if name != "debian":
        sys.exit(f"FROM {image}: only debian can be made here")
    mirror = os.environ.get("DEBIAN_MIRROR", "http://deb.debian.org/debian")
    subprocess.run(["debootstrap", "--variant=minbase", tag.removesuffix("-slim"), str(root), mirror], check=True)
    for path in map(Path, _NETWORK):
        target = root / path.relative_to("/")
        if path.is_dir():
            shutil.copytree(path, target, dirs_exist_ok=True)
        elif path.is_file():
            shutil.copyfile(path, target)


def _copy(root: Path, pattern: str, target: str) -> None:
    """Files of the checkout into a folder of the root."""
    folder = root / target.strip("/")
    folder.mkdir(parents=True, exist_ok=True)
    for path in sorted(ROOT.glob(pattern)):
        shutil.copy(path, folder)


def main() -> None:
    """Builds and tries."""
    parser = argparse.ArgumentParser(description="Builds the image of the Dockerfile and tries it.")
    parser.add_argument("--root", type=Path, help="an empty folder in which the steps run, also where docker is")
    root = parser.parse_args().root
    if not sorted((ROOT / "dist").glob("*.whl")):
        sys.exit("dist/ has no wheel: make wheel")
    if root is None and has_docker():
        with_docker()
    elif shutil.which("debootstrap") is None or os.getuid() != 0:
        sys.exit("no docker answers here; without it, this needs debootstrap (apt-get install debootstrap) and root")
    elif root is not None:
        in_root(root, steps_of((ROOT / "Dockerfile").read_text(encoding="utf-8")))
    else:
        with tempfile.TemporaryDirectory() as made:
            in_root(Path(made), steps_of((ROOT / "Dockerfile").read_text(encoding="utf-8")))
    print("the image drives")


if __name__ == "__main__":
    main()
