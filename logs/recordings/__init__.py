"""Import of recordings of robots as trial logs: of any source, through a mapping."""
