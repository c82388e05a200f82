"""What the adapters of third-party planners do where the third party is not installed."""

import pytest
from click.testing import CliRunner

import interdrive as idr
from interdrive.cli import main
from interdrive.planners import fiss, frenetix, reactive


@pytest.mark.parametrize(
    ("name", "module", "library"),
    [("fiss", fiss, "fiss"), ("frenetix", frenetix, "frenetix"), ("reactive", reactive, "ReactivePlanner")],
)
def test_a_planner_whose_extra_is_missing_says_what_to_install(name, module, library, monkeypatch):
    monkeypatch.setattr(module, library, None)
    line = f"planner {name} needs the extra: pip install interdrive[{name}]"
    with pytest.raises(idr.InterdriveError) as raised:
        idr.Simulation("t_junction", agents=1, planner=name)
    assert str(raised.value) == line
    told = CliRunner().invoke(main, ["run", "t_junction", "--planner", name])
    assert told.exit_code == 2
    assert told.output.strip() == f"error: {line}"
