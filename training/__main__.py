"""Everything from scenario files to shipped weights: `python -m training`; see README.md."""

from __future__ import annotations

import argparse
import csv
import hashlib
import os
import sys
import tarfile
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch

from interdrive.files import scenario_folders
from interdrive.predictors import Neural
from training.calibration import Calibration, calibrated, fitted, with_fitted_tail
from training.dataset import RIVALS, gather, scenario_files
from training.evaluate import errors, groups, modes_of, rival_modes, table
from training.export import digest_of, write_fixture, write_weights
from training.fit import Course, answer_to, fit, shares
from training.network import network_of, tensors_of
from training.networks import TrainedNetwork, load, save
from training.split import FOLDS, place_of, read_places
from training.tail import with_tail

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from training.dataset import Rows
    from training.evaluate import Modes
    from training.network import Answer, Network
    from training.split import Place

ROOT = Path(__file__).resolve().parents[1]
#: Modes that are looked at, as many as the predictor keeps by default.
MODES_MAX = Neural().modes_max
#: Rows of each third that the calibration is fitted to.
CALIBRATION_ROWS = 6000
#: How often a network in training is looked at [epochs].
LOOK = 5


def main() -> int:
    """Runs the command."""
    arguments = _arguments()
    torch.set_num_threads(1)  # the same sums whatever the machine
    torch.use_deterministic_algorithms(mode=True)
    started = time.perf_counter()
    places = read_places()
    files = scenario_files(_folders(arguments.scenarios, arguments.cache))
    if not files:
        print("no scenario files: name their folders (INTERDRIVE_SCENARIOS, INTERDRIVE_TRAINING)", file=sys.stderr)
        return 2
    rows = gather(files, places, arguments.cache)
    part_of = {place.name: place.part for place in places}
    part = np.array([part_of[name] for name in rows["place"]])
    say = _Clock(started)
    say(f"{len(files)} files, {len(part)} rows, {int((part == 'validation').sum())} of them for validation")

    course = Course(epochs=arguments.epochs, seed=arguments.seed)
    log: list[dict[str, object]] = []
    data = digest_of(files)
    made = {"data": data, "course": asdict(course)}
    earlier = []

    def trained(name: str, chosen: NDArray[np.bool_], unseen: NDArray[np.bool_] | None) -> Network:
        kept = arguments.networks / f"{name.replace(' ', '_')}.safetensors" if arguments.networks else None
        if kept is not None and kept.exists():
            found = load(kept, made)
            network, lines = network_of(found.tensors, found.sizes), found.lines
            earlier.append(name)
        else:
            lines = []
            network = _trained(name, rows, chosen, unseen, places, course, lines, say)
            if kept is not None:
                save(kept, TrainedNetwork(tensors_of(network), asdict(network.sizes), lines), made)
        log.extend(lines)
        return network

    held_out = {
        fold: trained(f"without {fold}", (part != fold) & (part != "validation"), part == fold) for fold in FOLDS
    }
    calibration = _calibration(held_out, rows, part, places)
    say(f"calibration: {calibration}")
    network = trained("shipped", part != "validation", None)

    arguments.log.mkdir(parents=True, exist_ok=True)
    _write_csv(arguments.log / "files.csv", _data_list(files, places))
    _write_csv(arguments.log / "training.csv", log)
    lines = _evaluation({**held_out, "validation": network}, rows, part, calibration, places)
    _write_csv(arguments.log / "evaluation.csv", lines)
    metadata = {"seed": str(course.seed), "epochs": str(course.epochs), "data": data, "files": str(len(files))}
    write_weights(arguments.weights, network, calibration, metadata)
    write_fixture(arguments.fixture, network, _only(rows, part == "validation"))
    say(f"wrote {arguments.weights} ({arguments.weights.stat().st_size // 1000} kB)")
    of_earlier = f"{len(earlier)} of {len(FOLDS) + 1} networks from an earlier run, " if earlier else ""
    minutes = (time.perf_counter() - started) / 60
    took = f"{minutes:.0f} min on one core, {of_earlier}rows from the cache"
    summary = _summary(lines, asdict(course), metadata, calibration, took)
    (arguments.log / "summary.txt").write_text(summary, encoding="utf-8")
    print(summary)
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m training", description=__doc__)
    default = [*(scenario_folders() or [Path("../shared/scenarios")])]
    default.append(Path(os.environ.get("INTERDRIVE_TRAINING", "../shared/training_scenarios.tar.xz")))
    parser.add_argument(
        "scenarios", nargs="*", type=Path, default=default,
        help="folders of scenario files, or archives of such; INTERDRIVE_SCENARIOS and INTERDRIVE_TRAINING otherwise",
    )  # fmt: skip
    cache = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "interdrive" / "training"
    parser.add_argument("--cache", type=Path, default=cache, help="where rows and unpacked archives are kept")
    parser.add_argument("--epochs", type=int, default=Course.epochs)
    parser.add_argument("--seed", type=int, default=Course.seed)
    parser.add_argument("--networks", type=Path, help="where networks are kept; those that are there are not trained")
    parser.add_argument("--log", type=Path, default=ROOT / "training" / "log")
    parser.add_argument("--weights", type=Path, default=ROOT / "python/interdrive/predictors/neural.safetensors")
    parser.add_argument("--fixture", type=Path, default=ROOT / "tests/predictors/neural_forward.npz")
    return parser.parse_args()


def _folders(given: Sequence[Path], cache: Path) -> list[Path]:
    """The folders, archives among them unpacked into the cache."""
    folders = []
    for path in given:
        if not path.is_file():
            folders.append(path)
            continue
        folder = cache / "unpacked" / path.name.partition(".")[0]
        if not folder.exists():
            unfinished = folder.with_suffix(".part")
            unfinished.mkdir(parents=True, exist_ok=True)
            with tarfile.open(path) as archive:
                archive.extractall(unfinished, filter="data")
            unfinished.rename(folder)
        folders.append(folder)
    return folders


class _Clock:
    """Says what happens, with the minutes since the start."""

    def __init__(self, started: float) -> None:
        self._started = started

    def __call__(self, text: str) -> None:
        print(f"{(time.perf_counter() - self._started) / 60:5.1f} min  {text}", flush=True)


def _only(rows: Rows, chosen: NDArray[np.bool_]) -> Rows:
    return {name: values[chosen] for name, values in rows.items()}


def _trained(
    name: str,
    rows: Rows,
    chosen: NDArray[np.bool_],
    unseen: NDArray[np.bool_] | None,
    places: tuple[Place, ...],
    course: Course,
    log: list[dict[str, object]],
    say: _Clock,
) -> Network:
    """A network trained on chosen rows, looked at now and then where it was not trained."""
    aside = _only(rows, unseen & (rows["made"] == "")) if unseen is not None else None

    def after(epoch: int, value: float, network: Network) -> None:
        line: dict[str, object] = {"network": name, "epoch": epoch, "loss": round(value, 4), "ratio": ""}
        if aside is not None and (epoch % LOOK == 0 or epoch == course.epochs):
            line["ratio"] = round(_ratio(network, aside, places), 4)
        log.append(line)
        if epoch % LOOK == 0:
            say(f"{name}, epoch {epoch}: loss {value:.3f}, error against lane_following {line['ratio']}")

    return fit(_only(rows, chosen), places, course, after)


def _ratio(network: Network, rows: Rows, places: tuple[Place, ...]) -> float:
    """Error at 3 s of the most probable mode over that of `lane_following`, both as means over the categories."""
    own = errors(modes_of(answer_to(network, rows), rows, MODES_MAX), rows)["fde"]
    rival = errors(rival_modes(rows, "lane_following"), rows)["fde"]
    found = groups(rows, _categories(places))
    del found["all"]
    return float(sum(own[c].mean() for c in found.values()) / sum(rival[c].mean() for c in found.values()))


def _categories(places: tuple[Place, ...]) -> Mapping[str, str]:
    return {place.name: place.category for place in places}


def _calibration(
    networks: Mapping[str, Network], rows: Rows, part: NDArray[np.str_], places: tuple[Place, ...]
) -> Calibration:
    """From what each network says of moving vehicles in the third that it was not trained on."""
    answers, agents, targets, weights, asked = [], [], [], [], []
    share = shares(rows, places) * (rows["made"] != "steady") * np.isfinite(rows["future"][:, -1, 0])
    generator = np.random.default_rng(0)
    for fold, network in networks.items():
        there = np.flatnonzero((part == fold) & (share > 0))
        drawn = generator.choice(there, CALIBRATION_ROWS, p=share[there] / share[there].sum())
        here = {name: values[drawn] for name, values in rows.items()}
        asked.append(here)
        answers.append(answer_to(network, here))
        agents.append(torch.from_numpy(here["agent"]))
        targets.append(torch.from_numpy(here["target"]))
        weights.append(torch.from_numpy((~here["standing"]).astype(np.float32) / CALIBRATION_ROWS))
    return with_fitted_tail(fitted(answers, agents, targets, weights), answers, asked, MODES_MAX)


def _evaluation(
    networks: Mapping[str, Network],
    rows: Rows,
    part: NDArray[np.str_],
    calibration: Calibration,
    places: tuple[Place, ...],
) -> list[dict[str, object]]:
    """Every network on the part of its name, none of which it was trained on, beside the rivals."""
    lines: list[dict[str, object]] = []
    traffic = {place.name: place.traffic for place in places}
    for name, network in networks.items():
        here = _only(rows, (part == name) & (rows["made"] == ""))
        said = _beside_rivals(network, calibration, here)
        found = table(said, here, _categories(places)) + _without_all(table(said, here, traffic))
        driven = _only(rows, (part == name) & (rows["made"] == "driven"))
        if len(driven["id"]):
            ours = dict.fromkeys(traffic, "driven")
            found += _without_all(table(_beside_rivals(network, calibration, driven), driven, ours))
        lines.extend({"part": name, **line} for line in found)
    return lines


def _beside_rivals(network: Network, calibration: Calibration, rows: Rows) -> dict[str, Modes]:
    rivals = {rival: rival_modes(rows, rival) for rival in RIVALS}
    return {"neural": _said(answer_to(network, rows), calibration, rows), **rivals}


def _said(answer: Answer, calibration: Calibration, rows: Rows) -> Modes:
    """What the predictor says."""
    agent, standing = torch.from_numpy(rows["agent"]), torch.from_numpy(rows["standing"])
    modes = modes_of(calibrated(answer, calibration, agent, standing), rows, MODES_MAX)
    return modes if calibration.tail is None else with_tail(modes, rows["standing"], calibration.tail)


def _without_all(lines: Sequence[dict[str, str | float]]) -> list[dict[str, str | float]]:
    return [line for line in lines if line["category"] != "all"]


def _data_list(files: Sequence[Path], places: tuple[Place, ...]) -> list[dict[str, object]]:
    found = []
    for path in files:
        place = place_of(path.stem, places)
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        found.append({"file": path.stem, "sha256": digest, "place": place.name, "part": place.part})
    return found


def _write_csv(path: Path, lines: Sequence[Mapping[str, object]]) -> None:
    columns = list(dict.fromkeys(column for line in lines for column in line))
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(lines)


def _summary(
    lines: Sequence[Mapping[str, object]],
    course: Mapping[str, object],
    metadata: Mapping[str, str],
    calibration: Calibration,
    took: str,
) -> str:
    """The figures that matter, as text."""
    text = [f"{name}: {value}" for name, value in {**metadata, "course": course}.items()]
    text += [f"calibration: {calibration}", f"time: {took}", ""]
    columns = ("part", "category", "predictor", "rows", "fde", "min_fde", "ade", "miss", "standing", "standing_median",
               "standing_p95", "inside_50_at_3s", "inside_90_at_3s", "inside_99_at_3s")  # fmt: skip
    text.append("  ".join(columns))
    text += ["  ".join(str(line.get(column, "")) for column in columns) for line in lines]
    return "\n".join(text) + "\n"


if __name__ == "__main__":
    sys.exit(main())
