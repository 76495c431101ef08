"""What an exported model consists of besides the simulation: copied into the exported file, which has no wingfit.

These modules may import numpy and, of wingfit, records and sim only.
"""
