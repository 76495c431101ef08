"""Limits of sizes and values in a dataset. Uploads are not trusted: sizes are checked before memory is allocated."""

MIB = 2**20

FORMAT_VERSION = 1  # version of the format that this code reads and writes
MAX_ARCHIVE_BYTES = 512 * MIB  # size of a zip or NetCDF file
MAX_EXPANDED_BYTES = 512 * MIB  # sum of the sizes of all files of a dataset, unpacked
MAX_COMPRESSION_RATIO = 200  # unpacked size over packed size; recordings have about 4, those with few values about 50
RATIO_FREE_BYTES = 16 * MIB  # below this unpacked size the ratio is not limited
MAX_ENTRIES = 5000  # entries in a zip, folders and unrelated files included
MAX_DESCRIPTION_BYTES = 16 * MIB  # size of dataset.yaml
MAX_ITEMS = 250_000  # keys, items of lists and values in dataset.yaml; each takes hundreds of bytes of memory
MAX_DEPTH = 12  # nesting of dataset.yaml; the format itself needs 6
MAX_RECORDINGS = 1000
MAX_MARKERS = 1000
MAX_STATIONS = 500
MAX_RODS = 50
MAX_HARMONICS = 50
MAX_ESTIMATES = 1000
MAX_QUANTITIES = 1000  # channels of a series, at most; as many inputs, and settings
MAX_COLUMNS = 3 * MAX_MARKERS + 1  # of a table: the times, and the coordinates of each marker

# Largest magnitude of a recorded number of a series, in any unit, and smallest of a standard deviation, period or
# difference of times: their squares and products are still finite.
LARGEST = 1e50
SMALLEST = 1e-50

MIN_FRAMES = 8  # instants in one recording, at least; fewer cannot resolve a beat
MAX_ROWS = 200_000  # instants in one recording, at most
MAX_VALUES = 64_000_000  # numbers in one dataset, 8 bytes each in memory
# Numbers in an uploaded NetCDF file, which is read within a limit of memory (`records/files/confined.py`).
MAX_UPLOADED_NETCDF_VALUES = 8_000_000
MAX_NAME_BYTES = 1024  # length of the type of fixed-length texts in NetCDF, which every text occupies in memory
MAX_CHUNK_BYTES = 64 * MIB  # size of one chunk of a NetCDF variable, unpacked
MAX_ERRORS = 20  # errors in one report
PLANFORM_MARGIN = 0.01  # largest distance of a marker at rest from the planform, m
# Largest plausible median distance of markers from the hinge, in spans; beyond, the unit is not metres.
IMPLAUSIBLE_SPANS = 1.5
# Largest opening of wings that clap at the start of the beat, as a fraction of the range of the flap angle.
MAX_OPEN_AT_START = 0.1
# Largest plausible RMS force along an axis, in weights of the vehicle; beyond, the unit is not newtons.
IMPLAUSIBLE_WEIGHTS = 10
NEGLIGIBLE_WEIGHTS = 1e-6  # smallest plausible RMS force, in weights of the vehicle
# Fewer samples per beat mean that the times are in another unit or the flap frequency is wrong.
MIN_SAMPLES_PER_BEAT = 4
# Largest relative difference of the time steps of forces from their median: filters need even sampling.
UNEVEN_STEPS = 0.01
