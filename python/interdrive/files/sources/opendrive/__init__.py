"""OpenDRIVE: records of a document, curves, borders, links, lines; `reader` puts them together."""
