"""What the studies share: files, figures, gaits and planned robots."""
