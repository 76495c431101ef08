"""Series of a rig of the user's own on the page: their dataset, a run and a diagnosis that a driver simulates."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import wingfit
from tests.records.series_samples import arm_dataset
from tests.service.conftest import Api
from tests.service.pages.browsing import DRAWN, Seen, check_curves
from tests.service.pages.browsing import opened as watched
from tests.service.rigs import decay_rig
from tests.service.rigs.test_drive import DECLARED, client_of, driver, service, upload
from wingfit.client.transport import zip_folder
from wingfit.records import Channel, Quantity, Series, SeriesDataset
from wingfit.records.files.netcdf import write_netcdf

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Route

TEXT = "document.getElementById('{}').textContent"
REPORT = "document.getElementById('report').shadowRoot.textContent"
ROWS = "document.querySelectorAll('#{} tbody tr').length"
RIG = Path(decay_rig.__file__)
DELFLY = Path(__file__).parents[3] / "examples" / "delfly"
SHORT = {"population": 8, "max_generations": 4, "effects": ["leak"], "seed": 3}
HOSTILE = "<img src=x onerror=hit()>"


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    """A server on which the rig "decay" is installed."""
    entry = EntryPoint("decay", f"{decay_rig.__name__}:rig", "wingfit.rigs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("wingfit.rigs.load.entry_points", lambda group: [entry] if group == entry.group else [])
        with service(tmp_path_factory.mktemp("series") / "data") as api:
            yield api


@pytest.fixture(scope="module")
def decay(api: Api) -> str:
    return upload(api)


@pytest.fixture(scope="module")
def vehicle(api: Api, tmp_path_factory: pytest.TempPathFactory) -> str:
    archive = zip_folder(DELFLY, tmp_path_factory.mktemp("vehicle") / "delfly.zip")
    answer = api.client.post("/v1/datasets", files={"file": ("delfly.zip", archive.read_bytes())})
    return str(answer.json()["id"])


@pytest.fixture(scope="module")
def run(api: Api, decay: str) -> str:
    """A run whose rig this process has simulated."""
    made = str(api.submit(decay, rig=DECLARED, name="driven here", **SHORT)["id"])
    with client_of(api) as client:
        assert wingfit.drive(client, made, decay_rig.rig)["state"] == "SUCCEEDED"
    return made


def opened(browser: Browser, api: Api, **options: Any) -> Seen:
    seen = watched(browser, api, **options)
    seen.page.context.grant_permissions(["clipboard-read", "clipboard-write"], origin=seen.base)
    return seen


@pytest.fixture
def seen(browser: Browser, api: Api) -> Iterator[Seen]:
    seen = opened(browser, api)
    yield seen
    assert (seen.errors, seen.foreign) == ([], [])
    seen.page.context.close()


def copied(seen: Seen, button: str) -> str:
    seen.page.click(button)
    seen.wait(f"{TEXT.format('toast')} === 'Copied'")
    return str(seen.page.evaluate("navigator.clipboard.readText()"))


def panels(seen: Seen) -> list[str]:
    return seen.page.locator("#panels h4").all_inner_texts()


def drawn(seen: Seen, panel: int, name: str, trace: int = 0) -> list[Any]:
    return list(seen.page.evaluate(f"[...document.querySelectorAll('#panels .plot')[{panel}].data[{trace}].{name}]"))


def all_drawn(seen: Seen, count: int) -> None:
    seen.wait(f"[...document.querySelectorAll('#panels .plot')].filter((node) => node.data).length === {count}")


def test_the_dataset_shows_its_recordings_and_their_values(seen: Seen, api: Api) -> None:
    arm = upload(api, arm_dataset(), write_netcdf)
    seen.show(f"dataset={arm}")
    all_drawn(seen, 4)
    about = seen.page.inner_text("#dataset-about")
    assert about.startswith("series of rig motor arm · 3 channels · 4 recordings · ")
    heads = seen.page.locator("#recordings thead th").all_inner_texts()
    assert heads == ["Recording", "Use", "Samples", "Duration, s", "Missing, %", "mass, kg", "gear"]
    row = seen.rows("recordings")[2]
    assert (row[0], row[1], row[2], row[5:]) == ("heavy", "to fit", "40", ["0.3", "20"])
    seen.wait(DRAWN.format("conditions", 1))
    assert seen.page.inner_text("#conditions-title").lower() in ("gear against mass, kg", "mass, kg against gear")
    assert panels(seen) == ["angle, rad", "acceleration, m/s^2", "contact", "input voltage, V"]
    values = api.get(f"/v1/datasets/{arm}/series")
    assert drawn(seen, 0, "x") == values["time_s"]
    assert drawn(seen, 1, "y") == values["channels"]["acceleration"]
    assert None in drawn(seen, 1, "y"), "a gap where nothing was recorded"
    lost = values["missing"]["acceleration"]
    assert f"{lost['samples']} of acceleration" in seen.page.inner_text("#series-note")
    shaded = "document.querySelectorAll('#panels .plot')[1].layout.shapes.length"
    assert seen.page.evaluate(shaded) == len(lost["gaps"]) > 0
    seen.page.select_option("#series-recording", "heavy")
    heavy = api.get(f"/v1/datasets/{arm}/series?recording=heavy")["channels"]["angle"]
    seen.wait(f"document.querySelector('#panels .plot')?.data?.[0].y[0] === {heavy[0]}")
    assert ["angle", "channel", "rad", "axis; of an encoder"] in seen.rows("quantities")
    assert ["acceleration", "channel", "m/s^2", "tip"] in seen.rows("quantities")
    assert ["mass", "setting", "kg", "–"] in seen.rows("quantities")


def test_many_channels_and_samples_are_drawn_a_few_at_a_time(seen: Seen, api: Api) -> None:
    count, samples = 14, 20_000
    channels = tuple(Channel(f"c{k}", "V", 0.1) for k in range(count))
    times = np.linspace(0.0, 2.0, samples)
    values = np.stack([np.sin(times * (k + 1)) for k in range(count)], axis=1)
    values[:, 0] = np.nan
    values[[0, 60, 120], 0] = [1.0, 2.0, 3.0]
    recording = Series("long", times, channels, values, period=0.5)
    wide = upload(api, SeriesDataset("wide", "board", (recording,), channels), write_netcdf)
    seen.show(f"dataset={wide}")
    all_drawn(seen, 6)
    assert panels(seen) == [f"c{k}, V" for k in range(6)]
    assert "One in 6 of the 20,000 samples is shown." in seen.page.inner_text("#series-note")
    assert [value for value in drawn(seen, 0, "y", 1) if value is not None] == [1.0, 2.0, 3.0], "alone"
    seen.page.select_option("#series-shown", label="c12 to c13")
    all_drawn(seen, 2)
    seen.page.click("#series-over >> text=Over the beat")
    seen.wait("document.querySelector('#panels .plot')?.data?.[0].x.includes(null)")
    phases = drawn(seen, 0, "x")
    assert phases.count(None) == 3, "four periods of half a second, one over the other"
    assert [value for value in phases if value is not None] == pytest.approx(times[::6] % 0.5 / 0.5, abs=1e-9)
    assert panels(seen) == ["c12, V", "c13, V"]


def test_the_panel_says_how_to_simulate(seen: Seen, api: Api, decay: str) -> None:
    for button in ("run", "diagnose"):
        seen.show("")
        seen.page.click(f"[data-key={button}-{decay}]")
        seen.wait(f"location.hash === '#dataset={decay}' && document.activeElement.id === 'simulate-title'")
        assert not seen.page.evaluate("document.getElementById('submit-dialog').open")
        assert seen.page.evaluate(
            "document.getElementById('simulate-title').getBoundingClientRect().bottom < innerHeight"
        )
        seen.page.focus("#dataset-archive")
    seen.page.click("#dataset-run")
    seen.wait("document.activeElement.id === 'simulate-title'")
    url = str(api.client.base_url).rstrip("/")
    texts = seen.page.locator("#own-rig pre").all_inner_texts()
    assert texts[:2] == [
        f"wingfit diagnose {decay} --rig my_rig.py --url {url}",
        f"wingfit runs submit {decay} --rig my_rig.py --url {url}",
    ]
    assert copied(seen, "#own-rig .copyable:first-child button") == texts[0]


def test_what_the_panel_gives_to_copy_works(seen: Seen, api: Api, decay: str, tmp_path: Path) -> None:
    (tmp_path / "my_rig.py").write_text(RIG.read_text())
    seen.show(f"dataset={decay}")
    seen.page.wait_for_selector("#own-rig pre")
    program = copied(seen, "#own-rig .copyable:last-child button")
    ended = _here([sys.executable, "-c", program], tmp_path)
    assert ended.stdout.strip() == "SUCCEEDED", ended.stderr
    command = seen.page.locator("#own-rig pre").nth(1).inner_text()
    words = [*shlex.split(command)[1:], "--max-generations", "2", "--population", "8"]
    ended = _here([sys.executable, "-m", "wingfit.cli.main", *words], tmp_path)
    assert ended.returncode == 0, ended.stderr
    newest = api.get("/v1/runs?limit=1")["items"][0]
    assert (newest["dataset_id"], newest["driven"], newest["state"]) == (decay, True, "SUCCEEDED")


def _here(command: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)


def test_an_installed_rig_is_calibrated_and_diagnosed(seen: Seen, api: Api, decay: str) -> None:
    seen.show(f"dataset={decay}")
    seen.page.wait_for_selector("#installed-form")
    assert seen.page.locator("#installed-form option").all_inner_texts() == ["decay"]
    seen.page.click("#installed-form [value=runs]")
    seen.wait("location.hash.startsWith('#run=')")
    made = seen.page.evaluate("location.hash").removeprefix("#run=")
    seen.wait("!document.getElementById('run-fit').hidden", 60)
    assert seen.page.is_hidden("#run-waiting")
    program = copied(seen, "#copy-python")
    seen.page.wait_for_selector("#toast", state="hidden")
    curl = shlex.split(copied(seen, "#copy-curl"))
    checked = api.client.post("/v1/runs?validate_only=true", json=json.loads(curl[curl.index("-d") + 1]))
    assert (checked.status_code, checked.json().get("spec")) == (200, api.run(made)["spec"])
    assert 'rig="decay"' in program
    arm = upload(api, arm_dataset(), write_netcdf)
    seen.show(f"dataset={arm}")
    name = api.get(f"/v1/datasets/{arm}")["name"]  # with a number: the service has another one of that name
    seen.wait(f"{TEXT.format('dataset-name')} === '{name}'")
    seen.page.click("#installed-form [value=runs]")
    seen.wait("!document.getElementById('installed-errors').hidden")
    assert "'decay' does not simulate" in seen.page.inner_text("#installed-errors")
    seen.errors.clear()  # the browser reports the refusal
    seen.show(f"dataset={decay}")
    seen.wait(f"{TEXT.format('dataset-name')} === 'decay'")
    assert seen.page.is_hidden("#installed-errors")
    seen.page.click("#installed-form [value=diagnoses]")
    seen.wait("location.hash.startsWith('#diagnosis=')")
    seen.wait("document.getElementById('report').shadowRoot?.querySelector('h1')", 60)
    assert "leak" in str(seen.page.evaluate(REPORT))


def test_lines_end_where_samples_are_missing(seen: Seen, run: str) -> None:
    def without_a_block(route: Route) -> None:
        result = route.fetch().json()
        for curve, name in product(result["curves"], ("time_s", "recorded", "nominal", "best")):
            curve[name] = curve[name][:10] + curve[name][20:]
        route.fulfill(json=result)

    seen.page.route("**/result", without_a_block)
    seen.open(run)
    seen.wait(DRAWN.format("curve-plot", 3))
    recorded, _, best, residual = (seen.data("curve-plot", trace, "y") for trace in range(4))
    assert [values.index(None) for values in (recorded, best, residual)] == [10] * 3
    assert residual[:10] == pytest.approx(np.subtract(recorded[:10], best[:10])), "of the best genome alone"


def test_a_driven_run_is_followed_to_its_end(seen: Seen, api: Api, decay: str) -> None:
    made = api.submit(decay, rig=DECLARED, **SHORT)["id"]
    seen.open(made)
    seen.wait("!document.getElementById('run-waiting').hidden")
    command = f"wingfit drive {made} my_rig.py --url {str(api.client.base_url).rstrip('/')}"
    assert copied(seen, "#run-waiting button") == command
    assert seen.page.is_hidden("#copy-curl")
    assert "waits for its simulation" in seen.page.inner_text("#history-note")
    with driver(api, made):
        seen.wait("!document.getElementById('run-fit').hidden", 60)
    assert seen.page.is_hidden("#run-waiting")
    result = api.get(f"/v1/runs/{made}/result")
    seen.wait(f"{ROWS.format('series-misfit')} === {len(result['recordings'])}")
    numbers = dict(zip(*(seen.page.locator(f"#numbers {tag}").all_inner_texts() for tag in ("dt", "dd")), strict=True))
    after, unit = numbers["after, RMS of the fitted recordings"].split(" ", 1)
    assert unit == "× noise"
    assert float(after) == pytest.approx(result["after"], rel=0.01)
    assert "held out" in seen.rows("series-misfit")[2][1]
    assert seen.rows("series-misfit")[0][2] == "charge"
    assert seen.rows("series-misfit")[0][6] == "C"
    for part in ("tracks-part", "forces-part"):
        assert seen.page.is_hidden(f"#{part}")
    check_curves(seen, result["curves"])
    history = api.history(made)
    best = [item["best_percent"] for item in history]
    seen.wait(DRAWN.format("history", 1))
    assert [value for value in seen.data("history", 1, "y") if value is not None] == pytest.approx(best)
    remarks = seen.page.locator("#remarks li").all_inner_texts()
    assert [text.casefold() for text in remarks] == [f"{remark}.".casefold() for remark in result["remarks"]]
    assert any(text.startswith("charge0[from-3]: ") for text in remarks), "names of genes stay as they are"
    assert "leak.size" in [row[0] for row in seen.rows("genes")]
    seen.page.click("h1 a")
    card = seen.page.inner_text(f"[data-key={made}]")
    assert "% of range" in card


def test_a_driven_diagnosis_waits_then_shows_its_report(seen: Seen, api: Api, run: str) -> None:
    seen.open(run)
    seen.page.wait_for_selector("#diagnose-run")
    seen.page.click("#diagnose-run")
    seen.wait("location.hash.startsWith('#diagnosis=')")
    made = seen.page.evaluate("location.hash").removeprefix("#diagnosis=")
    seen.wait("!document.getElementById('diagnosis-waiting').hidden")
    assert f"wingfit drive {made} my_rig.py" in seen.page.inner_text("#diagnosis-waiting")
    assert seen.page.inner_text("#diagnosis-about").startswith("rig decay · with leak · ")
    with driver(api, made):
        seen.wait("document.getElementById('report').shadowRoot?.querySelector('h1')", 60)
    assert seen.page.is_hidden("#diagnosis-waiting")
    report = str(seen.page.evaluate(REPORT))
    assert "time" in report
    assert "phase of the beat" not in report


def test_lists_and_comparisons_have_the_units_of_series(
    seen: Seen, api: Api, run: str, decay: str, vehicle: str
) -> None:
    seen.show("datasets")
    seen.wait(f"{TEXT.format('listing-table')}.includes('series of rig decay')")
    seen.show(f"runs&dataset_id={decay}")
    seen.wait(f"{TEXT.format('listing-table')}.includes('driven here')")
    row = next(row for row in seen.rows("listing-table") if row[1] == "driven here")
    assert row[7].endswith(" % of range")
    assert row[8:10] == ["decay with leak", "auto, joint"]
    assert "mm" not in seen.page.inner_text("#listing-table")
    other = str(api.submit(decay, rig="decay", **SHORT | {"effects": []})["id"])
    api.finish(other, 60)
    seen.show(f"compare={run},{other}")
    seen.wait(DRAWN.format("compare-plot", 1))
    outcomes = seen.rows("compare-outcome")
    assert all(row[4].endswith("× noise") for row in outcomes)
    assert seen.data("compare-plot", 0, "y") == [item["best_percent"] for item in api.history(run)]
    assert [row[0] for row in seen.rows("compare-recordings")] == ["from-1", "from-2", "from-3"]
    forces = str(api.submit(vehicle, max_generations=1)["id"])
    api.finish(forces, 60)
    seen.show(f"compare={run},{forces}")
    seen.wait(f"{TEXT.format('compare-note')}.includes('shows only the runs on forces')")
    assert [row[4].split()[-1] for row in seen.rows("compare-outcome")] == ["noise", "mN"]


def test_the_form_of_new_runs_has_no_series(seen: Seen, decay: str, vehicle: str) -> None:
    seen.show("")
    seen.wait(f"document.querySelector('[data-key=run-{vehicle}]')")
    seen.page.click("#home-run")
    seen.wait("document.getElementById('submit-dialog').open")
    options = seen.page.locator("[name=dataset_id] option").evaluate_all("(all) => all.map((one) => one.value)")
    assert vehicle in options
    assert decay not in options


def test_an_uploaded_series_leads_to_its_page(seen: Seen, tmp_path: Path) -> None:
    archive = tmp_path / "swings.nc"
    archive.write_bytes(write_netcdf(arm_dataset()))
    seen.show("")
    seen.page.set_input_files("#file", archive)
    seen.wait("location.hash.startsWith('#dataset=') && document.activeElement.id === 'simulate-title'")


def test_what_users_write_is_text(seen: Seen, api: Api) -> None:
    seen.page.add_init_script("window.hit = () => { window.wasHit = true; };")
    channel = Channel("charge", f"m{HOSTILE}", 0.1, "", f"of {HOSTILE}")
    times = np.linspace(0.0, 1.0, 50)
    recording = Series("first", times, (channel,), np.sin(9 * times)[:, None], settings={"mass": 1.0})
    hostile = upload(
        api,
        SeriesDataset(
            f"d {HOSTILE}",
            f"rig {HOSTILE}",
            (recording,),
            (channel,),
            (),
            (Quantity("mass", HOSTILE, HOSTILE),),
            (),
            HOSTILE,
        ),
        write_netcdf,
    )
    seen.show(f"dataset={hostile}")
    all_drawn(seen, 1)
    assert HOSTILE in seen.page.inner_text("#dataset-about")
    assert panels(seen) == [f"charge, m{HOSTILE}"]
    assert seen.rows("quantities")[0][2:] == [f"m{HOSTILE}", f"of {HOSTILE}"]
    assert f"mass, {HOSTILE}" in seen.page.inner_text("#recordings thead")
    assert HOSTILE in str(seen.page.locator("#panels .ytitle").text_content())
    assert seen.page.locator("#dataset img, aside img").count() == 0
    assert not seen.page.evaluate("window.wasHit")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_stands_in_anyones_way(browser: Browser, api: Api, decay: str, run: str, scheme: str) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="pip install -e '.[dev]'")
    waiting = api.diagnose(decay, rig=DECLARED)["id"]
    pages = {
        f"dataset={decay}": "[...document.querySelectorAll('#panels .plot')].some((node) => node.data)",
        f"run={run}": f"{ROWS.format('series-misfit')} > 0",
        f"diagnosis={waiting}": "!document.getElementById('diagnosis-waiting').hidden",
    }
    wrong = {}
    for width in (1280, 390):
        seen = opened(browser, api, viewport={"width": width, "height": 800}, color_scheme=scheme)
        for address, condition in pages.items():
            seen.show(address)
            seen.wait(condition)
            found = axe.Axe().run(seen.page).response["violations"]
            wide = seen.page.evaluate("document.documentElement.scrollWidth") - width
            if found or wide > 0:
                wrong[f"{address.split('=')[0]} {width}"] = [
                    wide,
                    *((one["id"], one["nodes"][0]["target"]) for one in found),
                ]
        seen.page.context.close()
    api.client.post(f"/v1/diagnoses/{waiting}/cancel")
    assert wrong == {}, json.dumps(wrong, indent=1)
