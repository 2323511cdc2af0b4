"""What `eitsim cache` lists, and what `eitsim plan` says of a design."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from matcal.card import MaterialCard, write_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

CARD = MaterialCard("foam", Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                    conductivity=Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
DESIGN = "[punch]\nplace = { within_mm = 40 }\nforce_N = 0.2\n[accuracy]\nsignal = 0.05\n"


def test_a_cache_of_many_tables_fits_a_screen(command: Callable, tmp_path: Path,
                                              monkeypatch: pytest.MonkeyPatch) -> None:
    from touchcal import cache

    monkeypatch.setenv("TOUCHCAL_CACHE", str(tmp_path))
    for i in range(50):
        cache.kept(cache.key_of({"table": i}, ()), lambda: {"values": [1.0]})
    assert len(command("eitsim", "cache").stdout.splitlines()) <= 40
    assert len(command("eitsim", "cache", "--verbose").stdout.splitlines()) > 50


@pytest.mark.thorough
@pytest.mark.usefixtures("solved_once")
def test_the_forecast_of_a_sweep_is_what_the_sweep_takes(command: Callable, tmp_path: Path) -> None:
    write_card(CARD, tmp_path / "card.json")
    (tmp_path / "design.toml").write_text(DESIGN)
    asked = ("design.toml", "--card", "card.json", "--scenes", "6")
    done = command("eitsim", "plan", *asked, "--workers", "1", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    plan = json.loads(done.stdout)
    swept = command("eitsim", "sweep", *asked, "--workers", "1", "--out", "set", "--json", cwd=tmp_path)
    assert swept.returncode == 0, swept.stderr
    size = sum(file.stat().st_size for file in (tmp_path / "set").rglob("*.parquet"))
    assert (plan["rows"], plan["readings"], plan["tables"]) == (6, 208, 0)
    assert 0.5 < 1e6 * plan["disk_MB"] / size < 2


def test_a_design_whose_rows_all_fail_is_refused(command: Callable, tmp_path: Path) -> None:
    write_card(CARD, tmp_path / "card.json")
    (tmp_path / "design.toml").write_text("scenes = 2\n[punch]\nplace = { list = [[98, 0]] }\n")
    done = command("eitsim", "plan", "design.toml", "--card", "card.json", cwd=tmp_path)
    assert done.returncode == 2
    assert "none of 2 rows" in done.stderr
