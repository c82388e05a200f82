"""What the adapters of third-party planners do where the third party is not installed."""

import pytest

import interdrive as idr
from interdrive.planners import frenetix


def test_a_planner_whose_extra_is_missing_says_what_to_install(monkeypatch):
    monkeypatch.setattr(frenetix, "frenetix", None)
    with pytest.raises(
        idr.InterdriveError, match=r"^planner frenetix needs the extra: pip install interdrive\[frenetix\]$"
    ):
        idr.Simulation("t_junction", agents=1, planner="frenetix")
