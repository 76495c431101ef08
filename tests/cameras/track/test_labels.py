"""Labels by hand: what is read and refused, symmetric wings that need them, and wrong names that are found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.cameras.track.moving_wing import cloud_of, markers, moved
from tests.cameras.track.simulated_films import Filmed, filmed, grid
from wingfit.cameras.track.follow import follow
from wingfit.cameras.track.labelled import completed, misplaced
from wingfit.cameras.track.labels import Label, check_labels, read_labels
from wingfit.cameras.track.procedure import track
from wingfit.cameras.track.registration import looks_alike, register, surface_of
from wingfit.cameras.track.result import TrackedFilm
from wingfit.records.array_types import Array
from wingfit.records.errors import DatasetError

HEAD = "camera,frame,marker,x_px,y_px\n"
SPREAD = (0, 5, 24, 29, 14, 9)  # markers of the grid: corners and others
GRID = grid()


@pytest.fixture
def film(monkeypatch: pytest.MonkeyPatch) -> Filmed:
    return filmed(monkeypatch, GRID, frames=16)


def errors(film: Filmed, found: TrackedFilm) -> Array:
    """Distances [T, K] (m) from the true places of the markers with these names."""
    order = [film.names.index(name) for name in found.names]
    return np.asarray(np.linalg.norm(found.positions - film.true[:, order], axis=2))


def refusal(film: Filmed, labels: list[Label], **changes: object) -> str:
    with pytest.raises(DatasetError) as refused:
        track(film.with_labels(labels, **changes))
    return str(refused.value)


def exchanged(label: Label, one: str, two: str) -> Label:
    return replace(label, marker={one: two, two: one}.get(label.marker, label.marker))


def test_a_table_is_read() -> None:
    found = read_labels((HEAD + "left, 12,m01,3.5,-0.25\n\nright,12,m01,4,5\n").encode(), "labels.csv")
    assert found == (Label("left", 12, "m01", (3.5, -0.25)), Label("right", 12, "m01", (4.0, 5.0)))
    assert [one.place for one in found] == ["labels.csv, line 2", "labels.csv, line 4"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("camera,frame,marker,x,y\n", ["line 1", "the header is 'camera,frame,marker,x,y'", "it must be"]),
        ("", ["line 1", "the header is ''"]),
        (HEAD, ["holds no labels; leave the key 'labels' out"]),
        (HEAD + "a,1,m,3,4\na,1,m,3\n", ["line 3", "has 4 cells; it must have 5"]),
        (HEAD + "a,1.5,m,3,4\n", ["line 2", "frame '1.5' is no whole number; frames are counted from 0"]),
        (HEAD + "a,-1,m,3,4\n", ["line 2", "frame '-1'"]),
        (HEAD + "a,1,m,3,here\n", ["line 2", "y_px is 'here'; it must be a number of pixels"]),
        (HEAD + "a,1,m,nan,4\n", ["line 2", "x_px is 'nan'"]),
    ],
)  # fmt: skip
def test_a_table_that_is_wrong_is_refused(text: str, words: list[str]) -> None:
    with pytest.raises(DatasetError) as refused:
        read_labels(text.encode(), "labels.csv")
    assert all(word in str(refused.value) for word in words), str(refused.value)


@pytest.mark.parametrize(
    ("label", "words"),
    [
        (Label("c9", 1, "m00", (3, 4), "labels.csv, line 2"), ["labels.csv, line 2", "unknown camera 'c9'", "c0"]),
        (Label("c0", 1, "m99", (3, 4)), ["label of m99 in frame 1 of c0", "unknown marker 'm99'"]),
        (Label("c0", 1, "m00", (1023.7, 4)), ["pixel (1023.7, 4) is outside the image of 1024 x 800 px"]),
        (Label("c0", 1, "m00", (4, -0.6)), ["pixel (4, -0.6) is outside", "count from the upper left pixel"]),
        (Label("c0", 7, "m05", (5, 6)), ["'m05' is labelled twice in frame 7 of c0; keep one"]),
    ],
)
def test_labels_that_cannot_be_are_refused(film: Filmed, label: Label, words: list[str]) -> None:
    with pytest.raises(DatasetError) as refused:
        check_labels([*film.labels((7, 7), SPREAD), label], film.request.cameras, film.names)
    assert all(word in str(refused.value) for word in words), str(refused.value)


def test_too_few_labels_and_names_that_no_column_can_have_are_refused(film: Filmed) -> None:
    few = [label for label in film.labels((7, 7), SPREAD) if label.camera == "c0" or label.marker != "m05"]
    assert "5 markers are labelled in two cameras in all frames together; label at least 6" in refusal(film, few)
    strange = [replace(label, marker=f"{label.marker}, left") for label in few]
    words = refusal(film, strange, names=(), reference=None)
    assert "'m00, left' is no name of a marker; give it 1 to 64 letters, digits, or any of _ . -" in words
    # Each of two instants has fewer than together.
    parted = film.labels((7, 7), SPREAD[:3]) + film.labels((11, 11), SPREAD[3:])
    words = refusal(film, parted)
    assert "labels at frame 7 of c0, frame 7 of c1: 3 markers are labelled in two cameras at this instant" in words


def test_labels_that_no_film_shows_are_refused(film: Filmed) -> None:
    labels = film.labels((7, 7), SPREAD)
    beyond = replace(labels[3], frame=16)
    assert "frame 16 of c0 is not among those used, 0 to 15" in refusal(film, [*labels, beyond])
    assert "frame 7 of c0 is not among those used, 8 to 15" in refusal(film, labels, first=8)
    far = [replace(labels[0], pixel=(labels[0].pixel[0] + 8, labels[0].pixel[1])), *labels[1:]]
    words = refusal(film, far)
    assert "label of 'm00': the nearest detection is 8.7 px away; at most 6.0 px are allowed" in words
    same = [replace(labels[0], marker="m01", frame=7), *labels]
    assert "labels of 'm01' and 'm00' are the same detection in frame 7 of c0" in refusal(film, same)


@pytest.mark.parametrize("strobe", [False, True], ids=["continuous", "strobe"])
def test_a_symmetric_wing_takes_labels(monkeypatch: pytest.MonkeyPatch, strobe: bool) -> None:
    film = filmed(monkeypatch, GRID, frames=16, strobe=strobe)
    words = refusal(film, [])
    assert "the layout looks the same after a turn that takes 'm00' to the place of 'm24'" in words
    found = track(film.with_labels(film.labels((7, 7), SPREAD)))
    assert found.names == film.names
    assert np.isfinite(found.positions).all()
    assert errors(film, found).max() < 2e-3
    assert not any("label" in remark for remark in found.remarks)
    if strobe:  # the second frame of a flash shows it too; other frames do not
        later = [replace(label, frame=label.frame + 1) for label in film.labels((7, 7), SPREAD)]
        assert np.array_equal(track(film.with_labels(later)).positions, found.positions)
        none = [replace(label, frame=label.frame + 2) for label in film.labels((7, 7), SPREAD)]
        assert "frame 32 of c0 shows no flash; frame 30 is the nearest to label" in refusal(film, none)


def test_without_labels_half_of_the_turns_are_wrong(film: Filmed) -> None:
    """What the refusal prevents: the search by distances finds the grid, but turned."""
    turned = 0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        order = rng.permutation(len(GRID))
        covariance = np.tile(1e-10 * np.eye(3), (len(GRID), 1, 1))
        chosen, _ = register(GRID, film.true[0][order], covariance, seed)
        assert (chosen >= 0).all()
        turned += bool((order[chosen] != np.arange(len(GRID))).any())
    assert turned >= 2


def test_only_layouts_with_a_symmetry_look_alike() -> None:
    assert looks_alike(markers()) is None
    assert looks_alike(GRID) is not None
    assert looks_alike(GRID @ moved(np.eye(3), 0.1)) is not None
    key = GRID.copy()
    key[7] += [0.013, 0.02, 0.0]  # one marker beside its place makes it unique
    assert looks_alike(key) is None


def test_names_and_places_come_from_labels_alone(film: Filmed) -> None:
    labels = [replace(label, marker=f"t0{label.marker[2]}") for label in film.labels((7, 7), (1, 8, 24, 29, 15, 6, 12))]
    found = track(film.with_labels(labels, names=(), reference=None))
    assert found.names[:7] == ("t01", "t08", "t04", "t09", "t05", "t06", "t02")
    assert len(set(found.names)) == len(found.names) == len(GRID)
    assert np.isfinite(found.positions).all()
    for column, marker in enumerate((1, 8, 24, 29, 15, 6, 12)):
        assert np.linalg.norm(found.positions[:, column] - film.true[:, marker], axis=1).max() < 2e-3


@pytest.mark.parametrize("one_camera", [False, True])
def test_exchanged_names_are_found(film: Filmed, one_camera: bool) -> None:
    labels = [
        exchanged(label, "m14", "m15") if label.camera == "c0" or not one_camera else label
        for label in film.labels((7, 7), (*SPREAD, 15))
    ]
    words = refusal(film, labels)
    assert "labels at frame 7 of c0, frame 7 of c1" in words
    if one_camera:  # in a row along the rays, that still meet: far from the wing
        assert "'m14' is labelled" in words
        assert "mm from where it is by the other labels" in words
    else:
        assert "'m14' is labelled where 'm15' is" in words
        assert "'m15' is labelled where 'm14' is" in words
        assert "are the names exchanged?" in words


def test_rays_that_do_not_meet_name_the_marker(film: Filmed) -> None:
    labels = [
        exchanged(label, "m05", "m29") if label.camera == "c1" else label for label in film.labels((7, 7), SPREAD)
    ]
    words = refusal(film, labels)
    assert "the labels of 'm05' are not the same point: their rays miss each other by" in words
    assert "the labels of 'm29'" in words


@pytest.mark.parametrize("count", [6, 8, 12, 30])
def test_exchanged_names_are_found_on_a_bent_wing_and_right_ones_are_not(count: int) -> None:
    rng, both, named, refused = np.random.default_rng(count), 0, 0, 0
    for number in range(12):
        places = moved(GRID, rng.uniform(0, 0.33), bend=0.4) + 1e-4 * rng.standard_normal(GRID.shape)
        labelled = rng.choice(len(GRID), count, replace=False)
        given = np.full_like(places, np.nan)
        given[labelled] = places[labelled]
        refused += bool(misplaced(GRID, given))
        one = labelled[0]
        two = labelled[np.argsort(np.linalg.norm(GRID[labelled] - GRID[one], axis=1))[1 + number % 2]]
        given[[one, two]] = places[[two, one]]
        found = set(misplaced(GRID, given))
        both, named = both + ({one, two} <= found), named + bool(found & {one, two})
    assert refused == 0
    assert named >= 11
    assert both >= 10


def test_labels_on_a_line_are_refused(film: Filmed) -> None:
    assert "the labelled markers are nearly on a line" in refusal(film, film.labels((7, 7), range(6)))


def test_a_second_label_corrects_what_was_followed_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    """A layout whose places are not known, labelled turned by half at the second instant: remarked, and heeded."""
    film = filmed(monkeypatch, GRID, frames=16)
    turned = [replace(label, marker=f"m{29 - int(label.marker[1:]):02d}") for label in film.labels((11, 11), range(30))]
    found = track(film.with_labels(film.labels((4, 4), range(30)) + turned, names=(), reference=None))
    apart = errors(film, found)
    # Where names change, markers seem to jump, and some places there are left out.
    assert apart[:8].max() < 2e-3
    assert np.linalg.norm(found.positions[14:, ::-1] - film.true[14:], axis=2).max() < 2e-3
    assert not (np.nan_to_num(apart[:11]) > 2e-3).any()
    words = "at frame 11 of c0, frame 11 of c1, m00, m01, m02, m03, m04 were followed to other points than those"
    assert any(words in remark for remark in found.remarks)
    agreed = track(film.with_labels(film.labels((4, 4), SPREAD) + film.labels((11, 11), SPREAD)))
    assert errors(film, agreed).max() < 2e-3
    assert agreed.remarks == ()


def test_a_symmetric_wing_that_was_lost_is_remarked(monkeypatch: pytest.MonkeyPatch) -> None:
    film = filmed(monkeypatch, GRID, frames=20, hidden=lambda at: 9 <= at < 12)
    found = track(film.with_labels(film.labels((4, 4), SPREAD)))
    assert np.nanmax(errors(film, found)) < 2e-3
    assert any("the wing was lost and found again at frame 12 of c0" in remark for remark in found.remarks)


def test_clocks_that_differ_need_no_matching_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    """Frames with the same number, of which one shows the wing 22 ms later: markers are followed in the image."""
    film = filmed(monkeypatch, GRID, frames=24, late=(0.0, 0.022))
    found = track(film.with_labels(film.labels((10, 10), range(30)), within_s=0.03))
    offset = float(next(one for one in found.remarks if "clock of c1" in one).split(" is ")[1].split(" ms")[0])
    assert offset == pytest.approx(22, abs=0.3)
    assert np.isfinite(found.positions).mean() > 0.95
    order = np.rint(found.times * 120).astype(int)
    apart = np.linalg.norm(found.positions - film.true[order], axis=2)
    assert np.nanmax(apart) < 4e-3


def test_three_cameras_of_which_one_has_no_labels(monkeypatch: pytest.MonkeyPatch) -> None:
    film = filmed(monkeypatch, GRID, frames=12, angles=(-20.0, 0.0, 20.0))
    labels = [label for label in film.labels((5, 5, 5), SPREAD) if label.camera != "c1"]
    found = track(film.with_labels(labels))
    assert errors(film, found).max() < 2e-3
    assert np.isfinite(found.pixels).all()


def test_labels_spread_to_their_neighbours() -> None:
    rng = np.random.default_rng(2)
    true = moved(GRID, 0.05, bend=0.4)
    cloud, index = cloud_of(true, np.ones(len(GRID), dtype=bool), rng, false=15)
    fixed = np.full(len(GRID), -1)
    fixed[[*SPREAD]] = index[[*SPREAD]]
    chosen, _ = completed(GRID, cloud, fixed)
    assert (chosen[chosen >= 0] == index[chosen >= 0]).all()
    assert (chosen >= 0).sum() > 20
    known = {0: (chosen, true)}
    followed = follow([cloud], GRID, surface_of(GRID), lambda *_: None, known)
    assert followed is not None
    assert (followed.start, followed.again, followed.renamed) == (0, (), {})
