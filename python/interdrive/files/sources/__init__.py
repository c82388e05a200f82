"""Maps and recordings of other tools, read as scenarios: OpenDRIVE, Lanelet2, SUMO, Argoverse 2 and more.

A format is one `Format` in `formats`: its name, a test that recognises it by its content, and a reader. The reader
takes a `SourceFile` (the file, unpacked if it was compressed, with the name of its XML root; or a folder, or a file
with others beside it, which it opens with `SourceFile.beside` so that their hashes are known) and `SourceOptions`, and
returns a `Source`. Its `roads` are a `Roads`: lanes as pairs of borders in driving direction (equally many points, in
metres), with links, neighbours, limits, lines and a key each, exactly as the file has them, and with signs and traffic
lights at the ends of lanes; `None` where the map is another file, that of the option `map`. Its `tracks` are a
`Tracks`: all rows of a recording as columns, in the source's own times, with nan for what it does not state; `None` for
a map alone. What is left out, changed or in doubt goes into its `notes`, counted. A reader raises `InputError` for what
cannot be read at all: "FILE: what is wrong; what to do".

The rest is done here, the same for every format. `lanelets` turns `Roads` into the lanelets of a scenario (narrow,
short, folded and closed lanes, borders that do not meet, neighbours that are not mutual), `control` puts signs and
lights at these lanelets, `recorded` turns `Tracks` into obstacles on common time steps, and `reading` joins both with
map, options and notes to a `Scenario`. Readers know neither lanelet ids nor time steps, no other module knows a format.
Nothing here needs more than NumPy (and pyarrow for Parquet), follows links out of a file, or unpickles.
"""

from interdrive.files.sources.formats import FORMATS, Format, recognised
from interdrive.files.sources.model import Lane, Roads, Source, Tracks
from interdrive.files.sources.notes import Notes
from interdrive.files.sources.opening import SourceFile, content_sha256
from interdrive.files.sources.reading import scenario_of

__all__ = [
    "FORMATS",
    "Format",
    "Lane",
    "Notes",
    "Roads",
    "Source",
    "SourceFile",
    "Tracks",
    "content_sha256",
    "recognised",
    "scenario_of",
]
