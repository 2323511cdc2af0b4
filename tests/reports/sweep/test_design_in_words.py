"""The report of a data set says in words how its design drew each key."""

from collections.abc import Callable
from pathlib import Path

from eitsim.sweeps.dataset.parquet import read_manifest, write_manifest
from reports.sweep.sweep_report import report


def test_every_kind_of_draw_is_told(write_set: Callable[..., Path]) -> None:
    folder = write_set()
    manifest = read_manifest(folder)
    tables = {"punch": [{"place": {"grid": "polar", "spacing_mm": 9}, "force_N": {"list": [0.5, 1]},
                         "diameter_mm": {"dist": "normal", "mean": 14, "sd": 2, "lo": 10, "hi": 18}},
                        {"place": {"gap_mm": 20}, "depth_mm": {"rows": [1, 2.5]}, "fillet_mm": 0.5,
                         "profile": {"choice": ["flat", "cone"]}}]}
    source = {"file": "scenes.csv", "sha256": "0123456789abcdef"}
    write_manifest(folder, {**manifest, "design": {**manifest["design"], "tables": tables, "touches": [1, 2],
                                                   "source": source}})
    rows = dict(map(tuple, report(folder).tables["design"].rows))
    assert rows | {
        "table": "scenes.csv, sha256 0123456789ab", "touches": "a whole number from 1 to 2",
        "punch 1.place": "polar grid, spacing_mm 9", "punch 1.force_N": "in turn 0.5, 1",
        "punch 1.diameter_mm": "normal, mean 14, standard deviation 2, cut off to 10 ... 18",
        "punch 2.place": "uniform over the skin where the punch fits, gap_mm 20",
        "punch 2.depth_mm": "given for each of 2 scenes, from 1 to 2.5", "punch 2.profile": "one of flat, cone",
        "punch 2.fillet_mm": "0.5"} == rows
