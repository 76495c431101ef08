"""How large a dataset may be. Uploads come from strangers; sizes are checked before memory is spent."""

MIB = 2**20

FORMAT_VERSION = 1
"""Version of the format that this code reads and writes."""

MAX_ARCHIVE_BYTES = 512 * MIB
"""Size of a zip or NetCDF file as it is stored."""

MAX_EXPANDED_BYTES = 512 * MIB
"""Sum of the sizes of all files of a dataset, unpacked."""

MAX_COMPRESSION_RATIO = 200
"""Unpacked size over packed size; recordings reach about 4, sparse ones about 50."""

RATIO_FREE_BYTES = 16 * MIB
"""Below this unpacked size the ratio does not matter."""

MAX_ENTRIES = 5000
"""Entries in a zip, folders and unrelated files included."""

MAX_DESCRIPTION_BYTES = 16 * MIB
"""Size of dataset.yaml."""

MAX_ITEMS = 250_000
"""Keys, items of lists and values in dataset.yaml: each takes hundreds of bytes in memory, however short it is."""

MAX_DEPTH = 12
"""Nesting of dataset.yaml; the format itself needs 6."""

MAX_RECORDINGS = 1000
MAX_MARKERS = 1000
MAX_STATIONS = 500
MAX_RODS = 50
MAX_HARMONICS = 50
MAX_ESTIMATES = 1000

MIN_FRAMES = 8
"""Fewer instants cannot show one beat."""

MAX_ROWS = 200_000
"""Instants in one recording."""

MAX_VALUES = 64_000_000
"""Numbers in one dataset, 8 bytes each in memory."""

MAX_UPLOADED_NETCDF_VALUES = 8_000_000
"""Numbers in a NetCDF file from a stranger, which is read within limits of memory (`records/files/confined.py`)."""

MAX_NAME_BYTES = 1024
"""Length of a text of fixed length in NetCDF: each one takes it in memory, however short the text is."""

MAX_CHUNK_BYTES = 64 * MIB
"""Size of one chunk of a NetCDF variable, unpacked."""

MAX_ERRORS = 20
"""Errors reported at once."""

PLANFORM_MARGIN = 0.01
"""How far outside the planform a marker may sit at rest, m."""

IMPLAUSIBLE_SPANS = 1.5
"""Markers further than this many spans from the hinge (median) were not recorded in metres."""

MAX_OPEN_AT_START = 0.1
"""How far wings that clap may be open where the beat starts, as a part of the range of their flap angle."""

IMPLAUSIBLE_WEIGHTS = 10
"""Forces along an axis above this many weights of the vehicle (root mean square) were not recorded in newtons."""

NEGLIGIBLE_WEIGHTS = 1e-6
"""Nor those below this."""

MIN_SAMPLES_PER_BEAT = 4
"""Forces sampled more slowly than this show no beat: the times are in another unit, or the flap frequency is wrong."""

UNEVEN_STEPS = 0.01
"""How far the time steps of forces may differ from their median, relative: a filter needs an even clock."""
