"""The study of cooperation: what it drives, and how its runs become a table by variant."""

from types import MappingProxyType

import pytest

from interdrive.config.binding import bind
from interdrive.config.schema import SimulationSettings
from interdrive.files import shipped_scenario
from interdrive.storage import arrow_table
from interdrive.studies.cooperation import (
    COLUMNS,
    CooperationStudy,
    Variant,
    cooperation_study,
    cooperation_variants,
    save_cooperation,
    summary_table,
)


def study_of(*rows):
    """A study with the given cells of its runs; all others are zero."""
    kinds = {"label": "", "truth": False}
    whole = [{column.name: row.get(column.name, kinds.get(column.kind, 0)) for column in COLUMNS} for row in rows]
    table = arrow_table(COLUMNS, {column.name: [row[column.name] for row in whole] for column in COLUMNS})
    return CooperationStudy(table, "rollout", "neural", MappingProxyType({}), ())


def test_shares_delays_and_losses_span_what_is_asked():
    variants = cooperation_variants()
    assert {v.penetration for v in variants} == {0, 0.25, 0.5, 0.75, 1}
    assert max(v.delay for v in variants) == 1.0
    assert max(v.loss for v in variants) == 0.5
    assert len({v.name for v in variants}) == len(variants)
    assert all(v.is_drawn == (v.loss > 0 or 0 < v.penetration < 1) for v in variants)
    hidden = {(v.services, v.penetration) for v in variants if v.occlusion and v.penetration > 0}
    assert hidden == {(what, share) for what in ("cam", "cam+mcm", "cam+mcm+cpm") for share in (0.5, 1.0)}
    assert Variant(1.0, occlusion=True, cpm=True).settings["view.occlusion"] is True
    assert "view.occlusion" not in Variant(1.0).settings, "a setting of the user is kept"


@pytest.mark.long
def test_runs_with_occlusion_are_compared_with_those_without_v2x_that_have_it_too(tmp_path):
    study = study_of(
        {"scenario": "a", "variant": "0%", "agents": 4, "reached": 4, "time": 10.0},
        {"scenario": "a", "variant": "hidden", "agents": 4, "reached": 2, "time": 12.0, "occlusion": True},
        {
            "scenario": "a",
            "variant": "told",
            "agents": 4,
            "reached": 3,
            "time": 11.0,
            "occlusion": True,
            "penetration": 1.0,
            "services": "cam+cpm",
        },
    )
    *_, told = summary_table(study).to_pylist()
    assert (told["reached_change"], told["time_lost"]) == (0.25, -1.0)
    page = (save_cooperation(study, tmp_path / "study") / "cooperation.md").read_text()
    assert "| 100 % | CAM, CPM | 75.0 % | +25.0 (+25.0..+25.0) |" in page.split("With occlusion:")[1]


def test_changes_are_means_over_scenarios_of_differences_to_no_v2x():
    both = {"agents": 4, "variant": "100%", "penetration": 1.0}
    study = study_of(
        {"scenario": "a", "variant": "0%", "agents": 4, "reached": 4, "time": 10.0},
        {"scenario": "b", "variant": "0%", "agents": 4, "reached": 1, "time": 20.0, "collisions": 1},
        {"scenario": "a", **both, "reached": 3, "time": 11.0},
        {"scenario": "b", **both, "reached": 3, "time": 17.0},
    )
    none, full = summary_table(study).to_pylist()
    assert (none["reached"], none["reached_change"], none["collisions"]) == (0.625, 0.0, 1)
    assert (full["reached"], full["collisions"]) == (0.75, 0)
    assert full["reached_change"] == pytest.approx((-0.25 + 0.5) / 2)
    assert (full["reached_low"], full["reached_high"]) == (-0.25, 0.5), "of two scenarios each can be all of a sample"
    assert full["time_lost"] == pytest.approx(-1.0)


def test_the_share_of_critical_time_is_a_mean_over_the_seeds_of_a_scenario_then_over_scenarios(tmp_path):
    half = {"variant": "50%", "penetration": 0.5, "agents": 1}
    study = study_of(
        {"scenario": "a", "variant": "0%", "agents": 1, "ttc_share": 0.1},
        {"scenario": "b", "variant": "0%", "agents": 1, "ttc_share": 0.0},
        {"scenario": "a", **half, "seed": 0, "ttc_share": 0.2},
        {"scenario": "a", **half, "seed": 1, "ttc_share": 0.4},
        {"scenario": "b", **half, "ttc_share": 0.1},
    )
    none, some = summary_table(study).to_pylist()
    assert (none["ttc_share"], none["ttc_change"]) == (0.05, 0.0)
    assert some["ttc_share"] == pytest.approx(0.2), "not a third of 0.7"
    assert some["ttc_change"] == pytest.approx((0.2 + 0.1) / 2)
    assert (some["ttc_low"], some["ttc_high"]) == (pytest.approx(0.1), pytest.approx(0.2))
    page = (save_cooperation(study, tmp_path / "study") / "cooperation.md").read_text()
    assert "TTC < 1.5 s" in page and "| 20.00 % |" in page


def test_seeds_are_driven_where_something_is_drawn_and_the_folder_has_all_of_it(tmp_path):
    variants = (Variant(0.0), Variant(0.5), Variant(1.0, negotiate=True))
    settings = bind(SimulationSettings(), {"step.max_steps": 5})
    study = cooperation_study(
        [shipped_scenario("lane_merge")], variants, seeds=2, settings=settings, predictor="lane_following"
    )
    runs = study.table.to_pylist()
    assert [(run["variant"], run["seed"]) for run in runs] == [
        ("0%", 0), ("50%", 0), ("50%", 1), ("100%_negotiate", 0)
    ]  # fmt: skip
    assert [run["equipped"] for run in runs] == [0, 4, 4, 7]
    assert all((run["ttc_share"] > 0) == (run["min_ttc"] is not None and run["min_ttc"] < 1.5) for run in runs)
    folder = save_cooperation(study, tmp_path / "study")
    page = (folder / "cooperation.md").read_text().splitlines()
    assert len([line for line in page if line.startswith("|")]) == 2 + len(variants)
    assert page[2].startswith("| 0 % | no | 0 | 0 % |") and page[4].startswith("| 100 % | yes |")
    assert (folder / "cooperation.png").stat().st_size > 10_000
