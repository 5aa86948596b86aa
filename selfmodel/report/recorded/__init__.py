"""Files of earlier commands: what a diagnosis was made with, and the tables of campaigns."""
