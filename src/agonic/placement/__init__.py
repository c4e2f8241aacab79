"""Where magnetometers should sit: of a recording, of a table of places, of a list of parts."""
