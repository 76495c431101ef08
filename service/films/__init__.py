"""Films of wings as files of the data folder, and the tracking of their markers as jobs."""
