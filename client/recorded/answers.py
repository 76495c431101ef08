"""JSON answers that show a dataset: the described wing, recorded markers, forces and series, and the checks.

Positions are in the frame of the wing (x aft, y outboard, z up), forces in those of the body (x to the nose, z down).
"""

from __future__ import annotations

from typing import Literal

from typing_extensions import TypedDict

from wingfit.client.answers import Kind, Point

Numbers = list[float | None]
ForceName = Literal["x", "z", "lift", "drag"]


class DescribedRod(TypedDict):
    """A rod of the described wing, straight from its root to its tip; ``driven``: the drive turns it."""

    name: str
    root_mm: Point
    tip_mm: Point
    driven: bool


class DescribedMarker(TypedDict):
    """A marker of the described wing at rest; ``reference``: it defines the start of the beat."""

    name: str
    position_mm: Point
    reference: bool


class DescribedCamera(TypedDict):
    """A camera that filmed the recordings: its centre of projection."""

    name: str
    centre_mm: Point


class FrameErrors(TypedDict):
    """Standard errors of the frame of the tracks: rotations about x, y and z, and the origin along them."""

    rotation_deg: Point
    origin_mm: Point


class DescribedWing(TypedDict):
    """The wing that a dataset describes, at rest.

    ``outline_mm`` goes from the root along the leading edge to the tip and back along the trailing edge. The hinge axis
    is parallel to x, through ``hinge_mm`` (its x is 0). ``drive_deg`` is the described flap angle at equal steps of one
    beat.
    """

    name: str
    span_mm: float
    outline_mm: list[Point]
    rods: list[DescribedRod]
    markers: list[DescribedMarker]
    hinge_mm: Point
    drive_deg: list[float]
    frame_error: FrameErrors | None
    cameras: list[DescribedCamera]


class MarkerNoise(TypedDict):
    """Stated noise of the markers of a recording: standard deviations along x, y, z, and correlations xy, xz, yz."""

    standard_deviation_mm: list[Point]
    correlation: list[Point] | None


class Tracks(TypedDict):
    """The recorded markers over one beat: the mean of all beats, or the frames of the single beat ``beat``.

    ``phase[B]`` is the phase of the beat, from ``start``: where the reference markers cross the height of the hinge
    upwards, or time 0 if they do not. ``positions_mm[B][M][3]`` are null where no frame shows the marker.
    ``angle_deg[B]`` is the angle about the hinge by which the rest positions come nearest to the positions; the
    distances that then remain, root mean square over all frames of the recording, are ``distance_mm[M]`` by marker and
    ``misfit_mm`` in all. ``missing[M]`` counts the frames without the marker.
    """

    recording: str
    markers: list[str]
    frames: int
    beats: int
    beat: int | None
    start: Literal["reference markers", "time 0"]
    phase: list[float]
    angle_deg: Numbers
    positions_mm: list[list[Point]]
    misfit_mm: float | None
    misfit_percent: float | None
    distance_mm: Numbers
    missing: list[int]
    noise: MarkerNoise | None


class Gap(TypedDict):
    """Consecutive missing samples: times of the first and the last of them, and their number."""

    from_s: float
    to_s: float
    samples: int


class Missing(TypedDict):
    """The missing samples of a channel: their number, and the first runs of them."""

    samples: int
    gaps: list[Gap]


class SeriesValues(TypedDict):
    """One recording of a rig of the user's own: the values of its channels and inputs, in the dataset's units.

    Of a long recording only every ``stride``-th sample is sent; null where a value was not recorded. ``missing`` counts
    by channel, among all samples. ``period_s`` is that of the motion, ``noise`` the stated standard deviation of each
    channel in its unit; null if not stated.
    """

    recording: str
    time_s: list[float]
    channels: dict[str, list[float | None]]
    inputs: dict[str, list[float | None]]
    stride: int
    period_s: float | None
    noise: dict[str, float | None]
    missing: dict[str, Missing]


class ChannelSamples(TypedDict):
    """Values of one channel over time, null where missing: one in ``stride`` of the samples."""

    name: str
    values: Numbers
    missing: Missing


class Samples(TypedDict):
    """What was recorded over time: of a marker its coordinates x, y, z in mm, of a vehicle its forces in N.

    ``phase`` counts beats from the start of the first one; its whole part is the number of the beat.
    """

    recording: str
    marker: str | None
    unit: Literal["mm", "N"]
    samples: int
    stride: int
    time_s: list[float]
    phase: list[float]
    channels: list[ChannelSamples]


class MeanForce(TypedDict):
    """Mean beat of a force, at the phases of the answer, and the standard deviation of its stated noise."""

    name: ForceName
    mean_n: Numbers
    noise_n: float | None


class Forces(TypedDict):
    """The recorded forces over the mean beat, and the motion of the wings that was recorded or described.

    ``phase[B]`` begins where the wings are closest; lift and drag are of level flight, by the body pitch, and absent
    unless both axes were recorded. ``flap_deg`` and ``pitch_deg`` are flap angle and wing pitch at these phases;
    ``own_motion``: they were measured in this recording. ``weight_n`` is that of the vehicle.
    """

    recording: str
    beats: int
    phase: list[float]
    forces: list[MeanForce]
    flap_deg: list[float]
    pitch_deg: list[float]
    pitch_station: float
    own_motion: bool
    weight_n: float
    low_pass_hz: float | None


class Check(TypedDict):
    """One check of an upload: what it looks at, and how many likely mistakes of the dataset it found."""

    name: str
    question: str
    found: int


class Checks(TypedDict):
    """The checks of a dataset; ``carried_out`` is false for one that was uploaded before there were checks."""

    kind: Kind
    carried_out: bool
    checks: list[Check]
