"""README and pages stay short, and what they point to is there."""

import re
from pathlib import Path
from typing import Any

import pytest

import eitsim
import matcal
from eitsim.simulation.edge_effects import least_gap_m
from eitsim.simulation.words import DIPOLE, DIPOLE_FORCES_N
from eitsim.sweeps.design.card_draws import Cards
from eitsim.sweeps.design.design import design_from, read_design
from eitsim.sweeps.run.rows import blank_row

ROOT = Path(__file__).parents[1]
# all but the first page of the site, whose links lead to what its build makes
PAGES = [ROOT / "README.md", *(page for folder in ("", "how-to", "explanation")
                               for page in sorted((ROOT / "docs" / folder).glob("*.md")) if page.stem != "site")]
MOST_LINES, MOST_WORDS, MOST_WORDS_A_PAGE = 120, 1200, 1500


def shown(page: Path) -> str:
    """The text of a page without its comments, which name the tables of its figures."""
    return re.sub(r"\n*<!--.*?-->", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)


def test_the_readme_is_one_page() -> None:
    text = shown(PAGES[0])
    assert len(text.splitlines()) <= MOST_LINES
    assert len(text.split()) <= MOST_WORDS


@pytest.mark.parametrize("folder", ["how-to", "explanation"])
def test_pages_are_short(folder: str) -> None:
    words = {page.name: len(shown(page).split()) for page in (ROOT / "docs" / folder).glob("*.md")}
    assert words
    assert {name: count for name, count in words.items() if count > MOST_WORDS_A_PAGE} == {}


def test_links_lead_somewhere() -> None:
    links = [(page, *link) for page in PAGES for link in re.findall(
        r"\]\((?!https?:)([^)#]*)(#[^)]*)?\)", re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"),
                                                     flags=re.DOTALL))]
    for page, target, anchor in links:
        there = page.parent / target if target else page
        assert there.exists(), (page.name, target)
        if anchor:
            headings = re.findall(r"^#+ (.*)$", there.read_text(encoding="utf-8"), flags=re.MULTILINE)
            assert anchor[1:] in {re.sub(r"[^\w -]", "", h).lower().replace(" ", "-") for h in headings}, anchor


def test_files_that_pages_name_are_there() -> None:
    named = {(page.name, name) for page in PAGES for name in re.findall(
        r"\b(?:tests|benchmarks|examples|data_raw)/[\w./-]*\w", page.read_text(encoding="utf-8"))}
    assert [(page, name) for page, name in sorted(named) if not (ROOT / name).exists()] == []


def test_every_page_is_in_the_index() -> None:
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    for folder in ("how-to", "explanation"):
        for page in (ROOT / "docs" / folder).glob("*.md"):
            assert f"({folder}/{page.name})" in index, page.name


def test_the_first_python_of_the_pages_fits_a_card_and_simulates_the_scene_of_the_file(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, source in (("disc1.csv", "mts_uniaxial.txt"), ("lap.txt", "mts_shear.txt"),
                         ("specimen.toml", "specimen.toml")):
        (tmp_path / name).write_bytes((ROOT / "data_raw" / source).read_bytes())
    monkeypatch.chdir(tmp_path)
    pages = [(ROOT / "docs" / "how-to" / f"{name}.md").read_text(encoding="utf-8")
             for name in ("calibrate-a-foam", "simulate-touches")]
    first = [re.findall(r"^```python\n(.*?)^```", page, flags=re.DOTALL | re.MULTILINE)[0] for page in pages]
    names: dict[str, Any] = {}
    exec(first[0], names)
    foam = matcal.read_card("foam.json").hyperfoam
    assert foam is not None
    assert "*HYPERFOAM" in names["text"]
    skin = matcal.Conductivity(30.0, [-2, 2, -1], (0, 0.4))
    matcal.write_card(matcal.MaterialCard("foam", foam, conductivity=skin), "card.json")
    exec(first[1], names)
    (scene,) = re.findall(r"^```toml\n(.*?)^```", pages[1], flags=re.DOTALL | re.MULTILINE)
    Path("scene.toml").write_text(scene, encoding="utf-8")
    assert eitsim.read_scene("scene.toml") == names["scene"]
    assert names["found"].outcome == "ok"


def test_the_skin_of_its_page_is_planned(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "how-to" / "any-flat-skin.md").read_text(encoding="utf-8")
    block, design = re.findall(r"```toml\n(.*?)```", text, flags=re.DOTALL)
    (surface,) = re.findall(r"```text\n(.*?)```", text, flags=re.DOTALL)
    (tmp_path / "skin.toml").write_text(block, encoding="utf-8")
    (tmp_path / "design.toml").write_text(design, encoding="utf-8")
    assert read_design(tmp_path / "design.toml").scenes == 300
    scene = eitsim.read_scene(tmp_path / "skin.toml")
    (tmp_path / "surface.toml").write_text(re.sub(r"\[electrodes\].*?(?=\[punch\])", surface, block, flags=re.DOTALL),
                                           encoding="utf-8")
    assert eitsim.read_scene(tmp_path / "surface.toml").electrodes.kind == "surface"
    assert scene.electrodes.count == 24
    foam = matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm")
    card = matcal.MaterialCard("foam", foam, conductivity=matcal.Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
    assert eitsim.plan(scene, card).refusal == ""


def test_the_distances_to_keep_on_that_page_are_the_plans() -> None:
    text = (ROOT / "docs" / "how-to" / "any-flat-skin.md").read_text(encoding="utf-8")
    body = eitsim.Body(eitsim.Outline("rectangle", width_m=0.1, height_m=0.1))
    kept = [least_gap_m(eitsim.Scene(body, accuracy=eitsim.Accuracy(signal))) / 0.01 for signal in (0.01, 0.02, 0.1)]
    found = re.search(r"default accuracy ([0-9.]+) thicknesses, ([0-9.]+) with\s`signal = 0.02`, ([0-9.]+) with", text)
    assert found is not None
    assert [float(one) for one in found.groups()] == [round(gap, 1) for gap in kept]


def test_the_dipole_moments_on_their_page_are_the_plans() -> None:
    text = (ROOT / "docs" / "explanation" / "what-is-left-out.md").read_text(encoding="utf-8")
    assert f"at {', '.join(f'{force:g}' for force in DIPOLE_FORCES_N)} N |" in text
    rows = {strain: re.search(rf'^\| `"{strain}"`.*\| ([-0-9., ]+) \|$', text, flags=re.MULTILINE) for strain in DIPOLE}
    shown_on_page = {strain: row and tuple(map(float, row[1].split(","))) for strain, row in rows.items()}
    assert shown_on_page == DIPOLE


def test_the_distance_to_the_rim_on_its_page_is_the_plans() -> None:
    text = (ROOT / "docs" / "how-to" / "simulate-touches.md").read_text(encoding="utf-8")
    assert f"edge is nearer than {least_gap_m(eitsim.Scene()) * 1e3:.0f} mm to the rim" in text


def test_every_column_of_a_data_set_is_described() -> None:
    page = (ROOT / "docs" / "how-to" / "data-sets.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`(\w+)`", "".join(re.findall(r"^\| (`.*?) \|", page, flags=re.MULTILINE))))
    row = blank_row(design_from({"scenes": 1, "punch": {"force_N": [0.1, 1.0]}}), Cards(matcal.MaterialCard("any")))
    assert {name for name in row if not re.fullmatch(r"d?v_\d+", name)} - named == set()
