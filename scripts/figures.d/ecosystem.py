"""ecosystem: Roadfix among other tools. Each part adds its rows to MEASUREMENTS below its functions."""

MEASUREMENTS = {}
