"""Reports of runs, logs and campaigns as one HTML file."""
