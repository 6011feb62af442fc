"""From the bytes of a file to named columns: layout, strict reading, faults."""
